"""What is wrong with the documentation: declarations that nothing explains, statuses that are not in the closed list, links that lead nowhere."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from html.parser import HTMLParser
from pathlib import Path

import tree_sitter_c
from headers import ROOT, Header, Item, Member, groups
from tree_sitter import Language, Node, Parser

SOURCES = ROOT / "firmware" / "src"
EXPLAINED = ("struct", "enum", "function", "macro", "type")
RETVAL = re.compile(r"@retval (\w+)")


def complaints(headers: Sequence[Header], site: Path) -> list[str]:
    """A line each."""
    return [*unexplained(headers), *unknown_statuses(headers), *unannounced(headers, sorted(SOURCES.glob("*.c"))), *broken_links(site)]


def facts(headers: Sequence[Header], site: Path) -> list[tuple[str, str]]:
    """What holds when there is no complaint, with how much was looked at."""
    every = [item for h in headers for group in groups(h) for item in group]
    count = {kind: sum(i.kind == kind for i in every) for kind in EXPLAINED}
    members = sum(len(i.members) for i in every)
    links = sum(len(_Page(p).links) for p in site.rglob("*.html"))
    return [
        (
            "Every public function, type, macro, field and enum member of the library and of hal/ has words that say what it is, or a type of the library that does.",
            f"{len(headers)} headers: {count['function']} functions, {count['struct']} structs, {count['enum']} enums, {members} members, {count['macro']} macros",
        ),
        (
            "Every status that a header names is one of the closed list; every function that returns a status names those it can return, and its code names no other.",
            f"{sum(len(RETVAL.findall(i.text)) for i in every)} statuses of {sum(i.result == 'hg_status' for i in every)} functions",
        ),
        (
            "Every relative link and anchor of the markdown pages and of the generated ones leads somewhere.",
            f"{links} links in {len(list(site.rglob('*.html')))} pages",
        ),
    ]


# ---- words ----


def unexplained(headers: Sequence[Header]) -> list[str]:
    """Declarations without a word. One of several variants may speak for all, the fields for a struct, and a struct or enum of the library for a field of that type."""
    types = {i.name for h in headers for i in h.items if i.kind in ("struct", "enum")}
    wrong = []
    for h in headers:
        said = {i.name for group in groups(h) for i in group if group[0].text}
        for group in groups(h):
            item = group[0]
            if item.kind in EXPLAINED and not item.text and item.name not in said and not _by_members(item):
                wrong.append(f"{h.path.relative_to(ROOT)}:{item.line}: nothing says what {item.name} is")
            wrong += [f"{h.path.relative_to(ROOT)}:{m.line}: nothing says what {item.name}.{m.name} is" for m in item.members if not m.text and not _by_type(item, m, types)]
    return wrong


def _by_members(item: Item) -> bool:
    return item.kind == "struct" and bool(item.members) and all(m.text for m in item.members)


def _by_type(item: Item, member: Member, types: set[str]) -> bool:
    return item.kind == "struct" and bool(set(re.findall(r"\w+", member.code)) & types)


def unknown_statuses(headers: Sequence[Header]) -> list[str]:
    """Results of functions, held against hg_status."""
    known = {m.name for h in headers for i in h.items if i.name == "hg_status" for m in i.members}
    wrong = []
    for h in headers:
        for item, text in _functions(h):
            named = set(RETVAL.findall(text))
            place = f"{h.path.relative_to(ROOT)}:{item.line}"
            wrong += [f"{place}: {item.name} names {name}, which is no hg_status" for name in sorted(named - known)]
            if item.result == "hg_status" and not named:
                wrong.append(f"{place}: {item.name} returns a status and names none (@retval)")
    return wrong


def _functions(header: Header) -> Iterator[tuple[Item, str]]:
    """Functions, each with the comment that it may share."""
    return ((i, group[0].text) for group in groups(header) for i in group if i.kind == "function")


def unannounced(headers: Sequence[Header], sources: Sequence[Path]) -> list[str]:
    """Statuses that a function's own code answers and its header does not name. What it hands on from a call it makes is not looked at."""
    named = {i.name: set(RETVAL.findall(text)) for h in headers for i, text in _functions(h) if i.result == "hg_status"}
    wrong = []
    for path in sources:
        for node in Parser(Language(tree_sitter_c.language())).parse(path.read_bytes()).root_node.children:
            body = node.child_by_field_name("body")
            if node.type == "function_definition" and body and (name := _name(node)) in named:
                wrong += [f"{path.name}:{node.start_point.row + 1}: {name} answers {status}, which its header does not name" for status in sorted(_answers(body) - named[name])]
    return wrong


def _name(node: Node) -> str:
    """Of the function that is defined here."""
    while inner := node.child_by_field_name("declarator"):
        node = inner
    return (node.text or b"").decode()


def _answers(node: Node) -> set[str]:
    """Statuses that stand in a body, but for those that something is compared with."""
    if node.type == "identifier":
        text = (node.text or b"").decode()
        return {text} if re.fullmatch(r"HG_(OK|E_\w+)", text) and not _compared(node) else set()
    return {status for child in node.children for status in _answers(child)}


def _compared(node: Node) -> bool:
    around = node.parent
    while around and around.type == "parenthesized_expression":
        around = around.parent
    sign = around.child_by_field_name("operator") if around and around.type == "binary_expression" else None
    return bool(sign and sign.text in (b"==", b"!=")) or bool(around and around.type == "case_statement" and around.child_by_field_name("value") == node)


# ---- links ----


class _Page(HTMLParser):
    """Anchors and links of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """One tag."""
        for name, value in attrs:
            if name == "id" and value:
                if value in self.anchors:
                    self.links.append(f"#twice:{value}")
                self.anchors.add(value)
            elif name in ("href", "src") and value:
                self.links.append(value)


def broken_links(site: Path) -> list[str]:
    """Relative links of all pages of the site; it has every markdown file of the tree, with its links as they are there."""
    pages = {p.resolve(): _Page(p) for p in sorted(site.rglob("*.html"))}
    return [f"{path.relative_to(site.resolve())}: {why}" for path, page in pages.items() for link in page.links for why in _broken(path, link, pages)]


def _broken(path: Path, link: str, pages: dict[Path, _Page]) -> Iterator[str]:
    if link.startswith("#twice:"):
        yield f"the anchor {link.removeprefix('#twice:')} stands there twice"
        return
    if re.match(r"[a-z]+:", link):
        return
    name, _, anchor = link.partition("#")
    to = (path.parent / name).resolve() if name else path
    if not to.exists():
        yield f"{link} leads nowhere"
    elif anchor and to in pages and anchor not in pages[to].anchors:
        yield f"{link}: no such anchor"
