"""Reads the public headers as what they are, a manual: every declaration with the comments that belong to it, in the order of the file.

The headers keep the style of the code, not a tool's: a comment belongs to what it stands before, or to what it stands behind on its line. Declarations come from tree-sitter's
grammar of C; conditions of the preprocessor are taken out before, so that every variant which a build can have is read, under its condition.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import tree_sitter_c
from tree_sitter import Language, Node, Parser

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "firmware" / "include" / "hullguard"
BOARD = ROOT / "hal"


@dataclass(frozen=True)
class Member:
    """A field of a struct or a member of an enum."""

    name: str
    code: str  # "const hg_real *sigma", "HG_OK = 1"
    line: int  # from 1
    text: str  # what is said of it; "" if nothing is


@dataclass(frozen=True)
class Item:
    """What a page shows: a declaration, or a comment by itself."""

    kind: str  # function, struct, enum, type, macro, heading, note
    name: str
    code: str  # as written, without comments and bodies
    line: int  # from 1
    text: str
    members: tuple[Member, ...] = ()
    condition: str = ""  # of the preprocessor, for what not every build has
    result: str = ""  # type that a function returns
    follows: bool = False  # stands under the declaration before it, without a blank line


@dataclass(frozen=True)
class Header:
    """One file."""

    path: Path
    purpose: str  # the comment at its head
    includes: tuple[str, ...]
    items: tuple[Item, ...]

    @property
    def name(self) -> str:
        """Of the file."""
        return self.path.name


@dataclass
class _Comment:
    first: int  # lines, from 0
    last: int
    text: str
    taken: bool = False


@dataclass
class _Reading:
    """A file on its way through."""

    source: bytes
    raw: list[str]  # lines of the file
    lines: list[str]  # the same without conditions
    conditions: list[str]  # [lines]
    comments: list[_Comment] = field(default_factory=list)

    def text(self, node: Node) -> str:
        return self.source[node.start_byte : node.end_byte].decode()


def headers() -> list[Header]:
    """The library's headers in the reading order of hullguard.h, it first; then those of hal/."""
    first = read(LIBRARY / "hullguard.h")
    return [first, *(read(LIBRARY / Path(name).name) for name in first.includes), *(read(BOARD / name) for name in ("hal.h", "bare.h"))]


def groups(header: Header) -> list[list[Item]]:
    """What a header declares, its guard left out. Macros, types or functions on lines that follow one another share the comment of the first."""
    found: list[list[Item]] = []
    for item in header.items:
        if item.kind == "macro" and item.name.startswith("HULLGUARD_") and item.name.endswith("_H"):
            continue
        last = found[-1][-1] if found else None
        if last and not item.text and item.kind == last.kind in ("macro", "type", "function") and item.follows and item.condition == last.condition:
            found[-1].append(item)
        else:
            found.append([item])
    return found


def read(path: Path) -> Header:
    """One header."""
    return parse(path, path.read_text())


def parse(path: Path, text: str) -> Header:
    """A header's text."""
    raw = text.split("\n")
    lines, conditions = _flat(raw)
    reading = _Reading("\n".join(lines).encode(), raw, lines, conditions)
    root = Parser(Language(tree_sitter_c.language())).parse(reading.source).root_node
    if root.has_error:
        raise ValueError(f"{path}: not C as this reader knows it; see tests/docs/headers.py")
    _collect(reading, root)
    purpose = reading.comments[0].text.removeprefix("@file")
    reading.comments[0].taken = True
    items = [item for node in root.children for item in _item(reading, node)]
    items += [note for note in map(_note, (c for c in reading.comments if not c.taken)) if note]
    includes = re.findall(r'^#include "(.*)"', "\n".join(lines), re.MULTILINE)
    return Header(path, _dedent(purpose), tuple(includes), tuple(sorted(items, key=lambda item: item.line)))


def _flat(lines: list[str]) -> tuple[list[str], list[str]]:
    """Lines with those of conditions blanked, and the condition of each line: "" where every build has it."""
    flat: list[str] = []
    conditions: list[str] = []
    stack = [""]
    for line in lines:
        said = re.sub(r"/\*.*?\*/", "", line).strip()
        word, _, rest = said.partition(" ")
        if word in ("#if", "#ifdef", "#ifndef"):
            stack.append("" if re.fullmatch(r"(HULLGUARD_)?\w+_H|__cplusplus|(HG_)\w+", rest) and word != "#if" else rest)
        elif word in ("#else", "#elif"):
            before = stack.pop()
            stack.append(rest if word == "#elif" else f"not {before}" if before and " " not in before else "otherwise" if before else "")
        conditions.append(" and ".join(filter(None, stack)))
        if word == "#endif":
            stack.pop()
        keep = not re.match(r"#(if|else|elif|endif|error)|extern \"C\" \{|\}$", line) or (line == "}" and not _closes_linkage(flat))
        flat.append(line if keep else "")
    return flat, conditions


def _closes_linkage(before: list[str]) -> bool:
    """Is the next line, a lone brace, the end of extern "C"? No body is open there."""
    text = re.sub(r"/\*.*?\*/", "", "\n".join(before), flags=re.DOTALL)
    return text.count("{") == text.count("}")


# ---- comments ----


def _collect(reading: _Reading, node: Node) -> None:
    """Every comment outside of bodies."""
    for child in node.children:
        if child.type == "comment":
            text = _plain(reading.text(child))
            if not re.match(r"(deviation:|cppcheck-suppress)", text):
                reading.comments.append(_Comment(child.start_point.row, child.end_point.row, text))
        elif child.type != "compound_statement":
            _collect(reading, child)


def _plain(raw: str) -> str:
    """A comment without its signs; lines keep their indentation relative to one another."""
    first, *rest = raw.removeprefix("/**").removeprefix("/*").removesuffix("*/").rstrip().split("\n")
    rest = [re.sub(r"^ \* ?", "", line).rstrip() for line in rest]
    return "\n".join([first.strip(), *_dedent("\n".join(rest)).split("\n")]).strip("\n")


def _dedent(text: str) -> str:
    lines = text.strip("\n").split("\n")
    depth = min((len(line) - len(line.lstrip()) for line in lines if line.strip()), default=0)
    return "\n".join(line[depth:] for line in lines)


def _before(reading: _Reading, row: int) -> str:
    """The comment that ends on the line above, unless that stands behind something else."""
    above = row - 1
    while above > 0 and reading.raw[above].startswith("#if"):  # the condition of what follows
        above -= 1
    for comment in reading.comments:
        if comment.last == above and not comment.taken and reading.lines[comment.first].lstrip().startswith("/*") and not _heading(comment.text):
            comment.taken = True
            return comment.text
    return ""


def _behind(reading: _Reading, row: int) -> str:
    """The comment that stands behind something on its line."""
    for comment in reading.comments:
        if comment.first == row and not comment.taken:
            comment.taken = True
            return comment.text
    return ""


def _heading(text: str) -> str:
    match = re.fullmatch(r"-{3,} (.*?) -{3,}", text)
    return match.group(1) if match else ""


def _note(comment: _Comment) -> Item | None:
    """A comment that belongs to no declaration."""
    title = _heading(comment.text)
    return Item("heading" if title else "note", "", "", comment.first + 1, title or comment.text)


# ---- declarations ----


def _follows(reading: _Reading, row: int) -> bool:
    """Whether nothing but conditions lies between this line and a declaration above."""
    above = row - 1
    while above > 0 and re.match(r"#(if|endif)", reading.raw[above]):
        above -= 1
    return re.match(r"#define|[a-z]", reading.raw[above]) is not None


def _item(reading: _Reading, node: Node) -> list[Item]:
    make = {"preproc_def": _macro, "preproc_function_def": _macro, "type_definition": _type, "declaration": _function, "function_definition": _function}.get(node.type)
    return [replace(make(reading, node), follows=_follows(reading, node.start_point.row))] if make else []


def _place(reading: _Reading, node: Node) -> tuple[int, str]:
    """Line and condition."""
    return node.start_point.row + 1, reading.conditions[node.start_point.row]


def _macro(reading: _Reading, node: Node) -> Item:
    line, condition = _place(reading, node)
    name = node.child_by_field_name("name")
    assert name
    code = re.sub(r"\s*/\*.*", "", reading.text(node), flags=re.DOTALL).strip()
    behind = _behind(reading, node.start_point.row)
    said = [_before(reading, node.start_point.row), behind]
    return Item("macro", reading.text(name), code, line, "\n".join(filter(None, said)), condition=condition)


def _type(reading: _Reading, node: Node) -> Item:
    line, condition = _place(reading, node)
    body = next((part for child in node.children if child.type in ("struct_specifier", "enum_specifier") and (part := child.child_by_field_name("body"))), None)
    declared = node.child_by_field_name("declarator")
    assert declared
    before = _before(reading, node.start_point.row)
    if body is None:
        behind = _behind(reading, node.end_point.row)
        name = re.search(r"\w+$", _declared(declared, reading))
        assert name
        return Item("type", name.group(0), _bare(reading.text(node)), line, "\n".join(filter(None, (before, behind))), condition=condition)
    kind = "struct" if body.type == "field_declaration_list" else "enum"
    behind = _behind(reading, body.start_point.row) if body.start_point.row != body.end_point.row else ""
    members = tuple(_member(reading, child) for child in body.children if child.type in ("field_declaration", "enumerator"))
    text = "\n".join(filter(None, (before, behind)))
    return Item(kind, reading.text(declared), _bare(reading.text(node)), line, text, members, condition)


def _declared(node: Node, reading: _Reading) -> str:
    """The name inside of a declarator: of a pointer, an array, a function pointer."""
    inner = node.child_by_field_name("declarator")
    if inner is None:
        inner = next((c for c in node.children if c.type.endswith(("declarator", "identifier"))), None)
    return reading.text(node) if inner is None else _declared(inner, reading)


def _member(reading: _Reading, node: Node) -> Member:
    declared = node.child_by_field_name("declarator") or node.child_by_field_name("name")
    assert declared
    before = _before(reading, node.start_point.row)
    said = filter(None, (before, _behind(reading, node.end_point.row)))
    return Member(_declared(declared, reading), re.sub(r"\s+", " ", _bare(reading.text(node))).rstrip(";"), node.start_point.row + 1, "\n".join(said))


def _bare(code: str) -> str:
    """Without comments."""
    return "\n".join(line.rstrip() for line in re.sub(r" */\*.*?\*/", "", code, flags=re.DOTALL).split("\n") if line.strip())


def _function(reading: _Reading, node: Node) -> Item:
    line, condition = _place(reading, node)
    declared = node.child_by_field_name("declarator")
    body = node.child_by_field_name("body")
    kind = node.child_by_field_name("type")
    assert declared and kind
    code = reading.source[node.start_byte : body.start_byte if body else node.end_byte].decode().strip().rstrip(";")
    code = re.sub(r"\s+", " ", _bare(code))
    text = _before(reading, node.start_point.row)
    return Item("function", _declared(declared, reading), code, line, text, condition=condition, result=reading.text(kind) + ("*" if "*" in code.split("(")[0] else ""))
