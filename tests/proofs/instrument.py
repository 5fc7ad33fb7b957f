"""Copies of the library's sources in which every subscript of an array is checked: what the model checker sees in place of firmware/.

CBMC checks a pointer against the whole object it points into, so that running from one member array of a struct into the next goes unseen. Here a[i]
becomes a[PROOF_INDEX(a, i)] (tests/proofs/proof.h), which asserts that i is a place of a where a is an array, and is i where it is a pointer. Products, quotients, sums and differences
become PROOF_TIMES(a, b) and the like, which are just that, or, for proofs that hold whatever a floating-point result is, any number. Lines stay as they are.
"""

from __future__ import annotations

import re
from pathlib import Path

import tree_sitter_c
from tree_sitter import Language, Node, Parser, Tree

_PARSER = Parser(Language(tree_sitter_c.language()))


class InstrumentError(Exception):
    """A source that cannot be instrumented; one line says why."""


def _source(path: Path) -> bytes:
    """Its text, with blanks for what is for C++ alone: the halves of a pair of braces, each in a conditional of its own, are nothing the grammar knows."""
    return re.sub(rb"^#ifdef __cplusplus\n.*?^#endif$", lambda m: re.sub(rb"[^\n]", b" ", m[0]), path.read_bytes(), flags=re.MULTILINE | re.DOTALL)


def parse(path: Path) -> Tree:
    """Syntax tree of a C source; stops at what the grammar does not know, in which nothing could be checked."""
    tree = _PARSER.parse(_source(path))
    if tree.root_node.has_error:
        line = next(n for n in nodes(tree.root_node) if n.is_error or n.is_missing).start_point[0] + 1
        raise InstrumentError(f"{path}:{line}: not understood by the C grammar")
    return tree


def nodes(root: Node) -> list[Node]:
    """All nodes, in the order of the text."""
    found, waiting = [], [root]
    while waiting:
        node = waiting.pop()
        found.append(node)
        waiting += reversed(node.children)
    return found


def text_of(node: Node) -> str:
    """Its source text."""
    assert node.text is not None
    return node.text.decode()


_ARITHMETIC = {"*": b"PROOF_TIMES", "/": b"PROOF_OVER", "+": b"PROOF_PLUS", "-": b"PROOF_MINUS"}
_CONSTANT = ("preproc_if", "preproc_elif", "array_declarator", "enumerator")  # what the compiler computes


def _rewritten(node: Node, source: bytes, constant: bool = False) -> bytes:
    """Its text with every subscript in it checked and its arithmetic named."""
    left, operator, right = (node.child_by_field_name(name) for name in ("left", "operator", "right"))
    if node.type == "subscript_expression":
        array, index = (_rewritten(child, source, constant) for child in (node.child(0), node.child(2)) if child is not None)
        return b"%b[PROOF_INDEX(%b, %b)]" % (array, array, index)
    if not constant and left is not None and right is not None and operator is not None and operator.type.removesuffix("=") in _ARITHMETIC:
        result = b"%b(%b, %b)" % (_ARITHMETIC[operator.type.removesuffix("=")], _rewritten(left, source), _rewritten(right, source))
        return result if node.type == "binary_expression" else _rewritten(left, source) + b" = " + result
    if not node.children:
        return source[node.start_byte : node.end_byte]
    out, at = b"", node.start_byte
    for i, child in enumerate(node.children):
        field = node.field_name_for_child(i)
        out += source[at : child.start_byte] + _rewritten(child, source, constant or (node.type in _CONSTANT and field in ("condition", "size", "value")))
        at = child.end_byte
    return out + source[at : node.end_byte]


def instrument(source: Path, target: Path) -> int:
    """Write the checked copy, unless it is there already. Returns the number of subscripts."""
    tree = parse(source)
    every = nodes(tree.root_node)
    for node in every:
        if node.type == "preproc_arg" and "[" in text_of(node):
            raise InstrumentError(f"{source}:{node.start_point[0] + 1}: a subscript in a macro cannot be checked")
    original = _source(source)
    text = original[: tree.root_node.start_byte] + _rewritten(tree.root_node, original) + original[tree.root_node.end_byte :]
    target.parent.mkdir(parents=True, exist_ok=True)
    if not target.exists() or target.read_bytes() != text:
        target.write_bytes(text)
    return sum(node.type == "subscript_expression" for node in every)
