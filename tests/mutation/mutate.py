"""Mutants of a C file, all in one: each stands beside the original and is chosen at run time by its number (mutant schemata).

A mutated expression becomes `(hg_is_mutant(17U) ? variant : original)`, a deleted statement `if (!hg_is_mutant(18U)) statement`. Every mutant stands on a line of
its own, so that a compiler's message about it tells which one does not compile; that one is left out.
"""

import re
from dataclasses import dataclass

import tree_sitter_c
from tree_sitter import Language, Node, Parser

ARITHMETIC = {"+": "-*", "-": "+*", "*": "+/", "/": "*%", "%": "/*"}
RELATIONAL = {"<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",)}
LOGICAL = {"&&": ("||",), "||": ("&&",)}
BITWISE = {"&": ("|", "^"), "|": ("&", "^"), "^": ("|", "&"), "<<": (">>",), ">>": ("<<",)}
ASSIGNMENT = {"+=": ("-=", "="), "-=": ("+=", "="), "*=": ("/=", "="), "|=": ("&=", "="), "&=": ("|=", "="), "^=": ("|=", "="), "<<=": (">>=",), ">>=": ("<<=",)}
SWAPPED = {"hg_real_min": "hg_real_max", "hg_real_max": "hg_real_min"}
CONSTANT = re.compile(r"[A-Z][A-Z0-9_]*[A-Z0-9]$")
SKIPPED = {"type_descriptor", "sizeof_expression", "preproc_def", "preproc_function_def", "preproc_include", "preproc_call", "enum_specifier", "struct_specifier", "comment"}
LOOPS = {"for_statement", "while_statement", "do_statement"}


@dataclass(frozen=True)
class Mutant:
    """One change of the source."""

    number: int  # among those of its file, from 1
    module: str
    function: str
    operator: str
    line: int
    original: str  # the source line, or the lines that it spans, blanks collapsed
    mutated: str

    @property
    def key(self) -> tuple[str, str, str, str, str]:
        """What an entry of the table of equivalent ones names."""
        return self.module, self.function, self.operator, self.original, self.mutated


class Mutator:
    """Writes one C file with all its mutants."""

    def __init__(self, module: str, source: str, left_out: frozenset[int] = frozenset()) -> None:
        self.module = module
        self.source = source.encode()
        self.left_out = left_out
        self.mutants: list[Mutant] = []
        self.function = ""
        self.returns = ""
        self.constants = set(re.findall(r"^#define ([A-Z]\w+) +(?:\(?-?[0-9(])", source, re.MULTILINE)) | {"UINT8_MAX", "UINT16_MAX", "HG_REAL_ZERO"}
        self.tree = Parser(Language(tree_sitter_c.language())).parse(self.source)

    def write(self) -> str:
        """The source with mutants."""
        return self.emit(self.tree.root_node)

    def text(self, node: Node) -> str:
        """Source text of a node."""
        return self.source[node.start_byte : node.end_byte].decode()

    # ---- the source anew, with mutants in it ----

    def emit(self, node: Node) -> str:
        """Text of a node, with what is mutated in it."""
        if node.type in SKIPPED or (node.type == "declaration" and self.constant_storage(node)):
            return self.text(node)
        if node.type == "function_definition":
            self.enter(node)
        inside = self.emit_children(node)
        if not self.function:
            return inside
        for operator, variant in self.variants(node):
            inside = self.choose(node, operator, variant, inside)
        unused = re.fullmatch(r"\(void\)\w+;", self.text(node)) is not None
        if node.type in {"expression_statement", "break_statement", "continue_statement"} and not (unused or self.ends_switch(node)):
            inside = self.delete(node, inside)
        return inside

    def emit_children(self, node: Node) -> str:
        """The children one after another, and what stands between them."""
        parts, at = [], node.start_byte
        for index, child in enumerate(node.children):
            parts.append(self.source[at : child.start_byte].decode())
            name = node.field_name_for_child(index)
            fixed = (node.type == "case_statement" and name == "value") or name in {"declarator", "type", "function", "directive", "label"}
            fixed = fixed or (node.type in {"preproc_if", "preproc_elif", "preproc_ifdef"} and name in {"condition", "name"})
            inside_value = name == "declarator" and child.type == "init_declarator"
            parts.append(self.text(child) if fixed and not inside_value else self.emit(child))
            at = child.end_byte
        parts.append(self.source[at : node.end_byte].decode())
        return "".join(parts)

    def constant_storage(self, node: Node) -> bool:
        """Is it initialised before the program runs?"""
        return not self.function or any(child.type == "storage_class_specifier" and child.text == b"static" for child in node.children)

    def enter(self, node: Node) -> None:
        """A function begins: its name and what it returns."""
        declarator = node.child_by_field_name("declarator")
        returns = node.child_by_field_name("type")
        assert declarator is not None and returns is not None
        pointer = declarator.type == "pointer_declarator"
        while declarator is not None and declarator.type != "identifier":
            declarator = declarator.child_by_field_name("declarator")
        self.function = self.text(declarator) if declarator else "?"
        self.returns = "*" if pointer else self.text(returns)

    # ---- kinds of mutants ----

    def variants(self, node: Node) -> list[tuple[str, str]]:
        """Operator and text of each variant of an expression."""
        found: list[tuple[str, str]] = []
        if node.type == "binary_expression":
            found = self.of_binary(node)
        elif node.type == "unary_expression" and self.text(node)[0] in "!-~":
            argument = node.child_by_field_name("argument")
            found = [("unary", self.text(argument))] if argument and argument.type != "number_literal" else []
        elif node.type == "number_literal":
            found = [("constant", value) for value in self.of_number(self.text(node))]
        elif node.type == "identifier" and self.text(node) in self.constants and self.is_value(node):
            found = [("constant", f"{self.text(node)} + 1"), ("constant", f"{self.text(node)} - 1")]
        elif node.type == "call_expression":
            found = self.of_call(node)
        elif node.type == "update_expression":
            other = {"++": "--", "--": "++"}[self.operator(node)]
            found = [("assignment", self.text(node).replace(self.operator(node), other))]
        elif node.type == "assignment_expression":
            found = self.swapped(node, "assignment", ASSIGNMENT.get(self.operator(node), ()))
        elif node.type == "cast_expression":
            found = self.of_cast(node)
        text = self.text(node)
        return [(operator, variant) for operator, variant in found + self.of_place(node) if variant != text]

    def of_binary(self, node: Node) -> list[tuple[str, str]]:
        sign = self.operator(node)
        for operator, table in (("arithmetic", ARITHMETIC), ("relational", RELATIONAL), ("logical", LOGICAL), ("bitwise", BITWISE)):
            if sign in table:
                return self.swapped(node, operator, tuple(table[sign]))
        return []

    def of_call(self, node: Node) -> list[tuple[str, str]]:
        function = node.child_by_field_name("function")
        name = self.text(function) if function else ""
        if name in SWAPPED:
            return [("minmax", self.text(node).replace(name, SWAPPED[name], 1))]
        if name == "HG_REAL_C":
            return [("constant", f"{self.text(node)} + {self.text(node)}"), ("constant", "HG_REAL_ZERO")]
        return []

    def of_cast(self, node: Node) -> list[tuple[str, str]]:
        """Where more bits than the cast leaves would be seen: inside another expression."""
        cast, value = node.child_by_field_name("type"), node.child_by_field_name("value")
        parent = node.parent
        inside = parent is not None and parent.type in {"binary_expression", "subscript_expression"} and self.operator(parent) != "&"
        seen = inside or self.is_condition(node)
        if not (cast and value and seen and self.text(cast) in {"uint8_t", "uint16_t"} and value.type == "parenthesized_expression"):
            return []
        return [("cast", self.text(value))]

    def of_number(self, text: str) -> list[str]:
        digits = re.match(r"(0[xX][0-9a-fA-F]+|[0-9]+)([uUlL]*)$", text)
        if digits is None:
            return []
        number, suffix = int(digits[1], 0), digits[2]
        values = {number + 1, number - 1, 0, 1} - {number, -1}
        return [f"{value}{suffix}" for value in sorted(values)]

    def of_place(self, node: Node) -> list[tuple[str, str]]:
        """What an expression may become by where it stands: as an index, a condition, a result."""
        parent = node.parent
        if parent is None:
            return []
        text = self.text(node)
        found: list[tuple[str, str]] = []
        if parent.type == "subscript_expression" and parent.child_by_field_name("index") == node and node.type != "number_literal":
            found += [("index", f"({text}) + 1"), ("index", f"({text}) - 1")]
        if self.is_condition(node):
            inner = node.named_children[0] if node.type == "parenthesized_expression" else node
            negated = inner.type == "unary_expression" or (inner.type == "binary_expression" and self.operator(inner) in RELATIONAL)
            whole = "({})" if node.type == "parenthesized_expression" else "{}"
            values = ([] if negated else [f"!({self.text(inner)})"]) + ["false"] + (["true"] if parent.type not in LOOPS else [])
            found += [("condition", whole.format(value)) for value in values]
        if parent.type == "return_statement" and node.is_named:
            found += self.of_result(node, text)
        return found

    def of_result(self, node: Node, text: str) -> list[tuple[str, str]]:
        negated = node.type == "unary_expression" or (node.type == "binary_expression" and self.operator(node) in RELATIONAL)
        if self.returns == "bool":
            return [("result", "true"), ("result", "false")] + ([] if negated or text in {"true", "false"} else [("result", f"!({text})")])
        if self.returns == "hg_status":
            return [("result", "HG_E_STATE")] if text == "HG_OK" else [("result", "HG_OK")]
        if self.returns in {"*", "void"} or (self.returns[:3] == "hg_" and self.returns not in {"hg_real", "hg_acc"}):
            return []
        return [("result", f"({text}) + 1"), ("result", "0")]

    def ends_switch(self, node: Node) -> bool:
        """Is it a break behind which the switch ends anyway?"""
        case = node.parent
        return node.type == "break_statement" and case is not None and case.type == "case_statement" and not (node.next_named_sibling or case.next_named_sibling)

    def is_condition(self, node: Node) -> bool:
        parent = node.parent
        kinds = {"if_statement", "while_statement", "for_statement", "conditional_expression", "do_statement"}
        return parent is not None and parent.type in kinds and parent.child_by_field_name("condition") == node

    def is_value(self, node: Node) -> bool:
        return (node.parent is not None and node.parent.type not in {"init_declarator", "parameter_declaration", "field_declaration"}) or self.is_initial(node)

    def is_initial(self, node: Node) -> bool:
        return node.parent is not None and node.parent.child_by_field_name("value") == node

    def operator(self, node: Node) -> str:
        found = node.child_by_field_name("operator")
        return self.text(found) if found else ""

    def swapped(self, node: Node, operator: str, others: tuple[str, ...]) -> list[tuple[str, str]]:
        """The same with another operator."""
        sign = node.child_by_field_name("operator")
        if sign is None:
            return []
        before = self.source[node.start_byte : sign.start_byte].decode()
        after = self.source[sign.end_byte : node.end_byte].decode()
        return [(operator, f"{before}{other}{after}") for other in others]

    # ---- putting them in ----

    def add(self, node: Node, operator: str, variant: str) -> int | None:
        """The number of a new mutant; None when it does not compile."""
        first = self.source.rfind(b"\n", 0, node.start_byte) + 1
        last = self.source.find(b"\n", node.end_byte)
        original = self.source[first:last].decode()
        mutated = self.source[first : node.start_byte].decode() + variant + self.source[node.end_byte : last].decode()
        number = len(self.mutants) + 1
        flat = [re.sub(r"\s+", " ", re.sub(r"/\*.*?\*/", "", text)).strip() for text in (original, mutated)]
        self.mutants.append(Mutant(number, self.module, self.function, operator, node.start_point[0] + 1, flat[0], flat[1]))
        return None if number in self.left_out else number

    def choose(self, node: Node, operator: str, variant: str, inside: str) -> str:
        number = self.add(node, operator, variant)
        if number is None:
            return inside
        plain = operator in {"assignment", "cast"} or self.is_condition(node)
        chosen = f"({variant})" if plain else f"(__typeof__({self.text(node)}))({variant})"
        return f"(\nhg_is_mutant({number}U) ? {chosen.replace(chr(10), ' ')} : (\n{inside}))"

    def delete(self, node: Node, inside: str) -> str:
        number = self.add(node, "deletion", "")
        return inside if number is None else f"if (!hg_is_mutant({number}U)) {{ {inside} }}"
