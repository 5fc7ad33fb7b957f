"""`make docs`: build/docs/, a page a header and a page a markdown file, to be read without a network, without scripts, and on paper."""

from __future__ import annotations

import html
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from check import complaints, facts
from headers import Header, Item, Member, groups, headers
from markdown_it import MarkdownIt
from markdown_it.token import Token

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "promises"))
from result import write_to

ROOT = Path(__file__).resolve().parents[2]
STYLE = Path(__file__).with_name("style.css")
WORD = re.compile(r"\b(hg|HG)_\w+|\b\w+\.h\b")
COLUMNS = "\0"  # begins a block that is set in columns
TAG = re.compile(r"@(param|retval)(\[[\w,]+\])?\s+")


@dataclass(frozen=True)
class Site:
    """What pages need to link to one another."""

    headers: tuple[Header, ...]
    pages: tuple[Path, ...]  # markdown, relative to the tree
    names: Mapping[str, str]  # declaration -> address, relative to the site
    out: Path


def markdown_files() -> tuple[Path, ...]:
    """Every markdown file of the tree, README first."""
    found = [p.relative_to(ROOT) for p in sorted(ROOT.rglob("*.md")) if not any(part == "build" or part.startswith(".") for part in p.relative_to(ROOT).parts)]
    return tuple(sorted(found, key=lambda p: (len(p.parts) > 1, str(p))))


def address(path: Path) -> str:
    """Where a file of the tree stands in the site, relative to the site."""
    if path.suffix == ".h":
        return f"api/{path.name}.html"
    return "readme.html" if path == Path("README.md") else str(path.with_suffix(".html"))


def planned(out: Path) -> Site:
    """The site before it is written."""
    every = tuple(headers())
    names = {h.name: address(h.path) for h in every}
    for h in every:
        for item in h.items:
            if item.name:
                names.setdefault(item.name, f"{address(h.path)}#{item.name}")
            for m in item.members if item.kind == "enum" else ():
                names.setdefault(m.name, f"{address(h.path)}#{m.name}")
    return Site(every, markdown_files(), names, out)


# ---- text ----


def linked(site: Site, text: str, here: str) -> str:
    """A comment's text for HTML: what it names becomes a link."""

    def link(match: re.Match[str]) -> str:
        to = site.names.get(match[0])
        return match[0] if to is None else f'<a href="{_relative(to, here)}">{match[0]}</a>'

    return WORD.sub(link, html.escape(text, quote=False))


def _relative(to: str, here: str) -> str:
    path, mark, anchor = to.partition("#")
    return (os.path.relpath(path, Path(here).parent) if path != here else "") + mark + anchor


def prose(site: Site, text: str, here: str) -> str:
    """A comment: paragraphs; what is indented or set in columns stays as it is; parameters and results as lists."""
    parts, rows = [], []
    for block in _blocks(text):
        if TAG.match(block):
            rows.append(block)
            continue
        parts += [_tags(site, rows, here)] if rows else []
        rows = []
        parts.append(f"<pre>{linked(site, block[len(COLUMNS) :], here)}</pre>" if block.startswith(COLUMNS) else f"<p>{linked(site, block, here)}</p>")
    return "\n".join([*parts, _tags(site, rows, here)] if rows else parts)


def _blocks(text: str) -> Iterator[str]:
    """Paragraphs, one tag each, and what is set in columns."""
    for part in re.sub(r"(?<=\S)  +(?=@(param|retval))", "\n", text).split("\n\n"):
        lines = [line for line in part.split("\n") if line.strip()]
        columns = not TAG.search(part) and sum(bool(re.search(r"\S {3,}\S", line)) for line in lines) > 1
        block: list[str] = []
        row = False
        for line in lines:
            column = columns or (line.startswith("    ") and not (block and TAG.match(block[0])))
            if block and (column != row or TAG.match(line) or (not column and re.match(r"(Cost|Result|Nothing else)\b", line))):
                yield _joined(block, row)
                block = []
            row = column
            block.append(line)
        if block:
            yield _joined(block, row)


def _joined(block: list[str], column: bool) -> str:
    return COLUMNS + textwrap.dedent("\n".join(block)) if column else " ".join(line.strip() for line in block)


def _tags(site: Site, rows: list[str], here: str) -> str:
    """Parameters and results."""
    out = []
    for row in rows:
        match = TAG.match(row)
        assert match
        name, _, rest = row[match.end() :].partition(" ")
        while name.endswith(","):  # several share a description
            more, _, rest = rest.strip().partition(" ")
            name = f"{name} {more}"
        way = f' <span class="way">{match[2].strip("[]")}</span>' if match[2] else ""
        kind = "param" if match[1] == "param" else "retval"
        out.append(f'<tr class="{kind}"><td><code>{linked(site, name, here)}</code>{way}</td><td>{linked(site, rest.strip(), here)}</td></tr>')
    return f'<table class="tags">{"".join(out)}</table>'


# ---- a header ----


def header_page(site: Site, h: Header) -> str:
    """One header, in its own order."""
    here = address(h.path)
    order = [x.name for x in site.headers]
    at = order.index(h.name)
    near = [f'<a href="{order[i]}.html">{sign}</a>' for i, sign in ((at - 1, f"← {order[at - 1]}"), (at + 1, f"{order[(at + 1) % len(order)]} →")) if 0 <= i < len(order)]
    parts = [f"<h1>{h.name}</h1>", prose(site, h.purpose, here), *_contents(site, h, here)]
    marked: set[str] = set()
    for group in groups(h):
        parts.append(_item(site, group, here, [i.name for i in group if i.name not in marked]))
        marked |= {i.name for i in group}
    return shell(site, h.name, "\n".join(parts), here, near)


def _contents(site: Site, h: Header, here: str) -> Iterator[str]:
    """What the header declares, by kind."""
    if h.name == "hullguard.h":
        yield _reading_order(site, here)
        return
    yield '<table class="contents">'
    for kind, title in (("struct", "Structures"), ("enum", "Enumerations"), ("type", "Types"), ("function", "Functions"), ("macro", "Macros")):
        names = list(dict.fromkeys(i.name for group in groups(h) for i in group if i.kind == kind))
        if names:
            yield f"<tr><th>{title}</th><td>{', '.join(f'<a href=#{n}>{n}</a>' for n in names)}</td></tr>"
    yield "</table>"


def _reading_order(site: Site, here: str) -> str:
    rows = []
    for h in site.headers:
        if h.name != Path(here).stem:
            first = re.split(r"(?<=[.:])\s", " ".join(next(_blocks(h.purpose)).split()), maxsplit=1)[0].rstrip(":")
            rows.append(f'<tr><td><a href="{_relative(address(h.path), here)}">{h.name}</a></td><td>{linked(site, first, here)}</td></tr>')
    return f'<table class="order">{"".join(rows)}</table>'


def _item(site: Site, group: list[Item], here: str, marked: list[str]) -> str:
    """One declaration, or several under one comment; anchors for the names in `marked`."""
    item = group[0]
    if item.kind == "heading":
        return f"<h2>{html.escape(item.text)}</h2>"
    if item.kind == "note":
        return prose(site, item.text, here)
    marks = "".join(f'<a id="{name}"></a>' for name in dict.fromkeys(marked))
    where = f'<span class="when">{html.escape(item.condition)}</span>' if item.condition else ""
    kind = f'<span class="kind">{item.kind}</span>'
    code = "\n".join(i.code for i in group) if item.kind in ("macro", "type") else "\n".join(_signature(i) for i in group) if item.kind == "function" else ""
    body = f"<pre class=code>{linked(site, code, here)}</pre>" if code else ""
    members = _members(site, item, here) if item.members else ""
    return f"<section class=item>{marks}<h3>{', '.join(i.name for i in group)} {kind}{where}</h3>\n{body}{prose(site, item.text, here)}{members}</section>"


def _signature(item: Item) -> str:
    """A prototype, a parameter a line where it is long."""
    if len(item.code) <= 100:
        return item.code
    head, _, rest = item.code.partition("(")
    return f"{head}(\n    " + re.sub(r",\s*(?![^(]*\))", ",\n    ", rest)


def _members(site: Site, item: Item, here: str) -> str:
    rows = []
    for m in item.members:
        mark = f'<a id="{m.name}"></a>' if item.kind == "enum" else ""
        rows.append(f"<tr><td>{mark}<code>{linked(site, m.code, here)}</code></td><td>{linked(site, _said(m), here)}</td></tr>")
    return f'<table class="members">{"".join(rows)}</table>'


def _said(m: Member) -> str:
    return " ".join(m.text.split()) or "what its type says"


# ---- markdown ----


def _slug(title: str, used: dict[str, int]) -> str:
    """The anchor that hosts of repositories give a heading."""
    plain = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
    used[plain] = used.get(plain, -1) + 1
    return plain if not used[plain] else f"{plain}-{used[plain]}"


def parsed(path: Path) -> list[Token]:
    """Tokens of a page, each heading with its anchor."""
    tokens = MarkdownIt("commonmark").enable("table").parse((ROOT / path).read_text())
    used: dict[str, int] = {}
    for token, inline in pairwise(tokens):
        if token.type == "heading_open":
            title = "".join(c.content for c in inline.children or () if c.type in ("text", "code_inline"))
            token.attrSet("id", _slug(title, used))
    return tokens


def markdown_page(site: Site, path: Path) -> str:
    """One markdown file."""
    here = address(path)
    tokens = parsed(path)
    for token in tokens:
        for child in token.children or ():
            if child.type == "link_open":
                child.attrSet("href", _target(site, path, str(child.attrGet("href")), here))
            elif child.type == "image":
                child.attrSet("src", _target(site, path, str(child.attrGet("src")), here))
    body = MarkdownIt("commonmark").enable("table").renderer.render(tokens, MarkdownIt("commonmark").options, {})
    body = re.sub(r"<table>", '<div class="wide"><table>', body).replace("</table>", "</table></div>")
    title = next((re.sub(r"^#+ ", "", line) for line in (ROOT / path).read_text().split("\n") if line.startswith("# ")), path.stem)
    return shell(site, title, body, here, [])


def _target(site: Site, page: Path, to: str, here: str) -> str:
    """A link of a page as the site has it: to a page, a header or a picture inside; to anything else of the tree, where that stands."""
    if re.match(r"[a-z]+:|#", to):
        return to
    name, mark, anchor = to.partition("#")
    path = Path(os.path.normpath(page.parent / name))
    if path in site.pages or any((ROOT / path) == h.path for h in site.headers):
        return _relative(address(path), here) + mark + anchor
    if path.suffix in (".png", ".svg") and (ROOT / path).is_file():
        kept = site.out / path
        kept.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / path, kept)
        return _relative(str(path), here)
    return os.path.relpath(ROOT / path, (site.out / here).parent) + mark + anchor


# ---- the shell around a page ----


def shell(site: Site, title: str, body: str, here: str, near: list[str]) -> str:
    """One whole page."""
    style, start = _relative("style.css", here), _relative("index.html", here)
    above = " · ".join([f'<a href="{start}">hullguard</a>', *near])
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width,initial-scale=1"><title>{html.escape(title)} – hullguard</title>'
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}<link rel="stylesheet" href="{style}"></head>\n<body><nav>{above}</nav><main>\n{body}\n</main></body></html>\n'


def index_page(site: Site) -> str:
    """The way in."""
    title = {p: next((line.lstrip("# ") for line in (ROOT / p).read_text().split("\n") if line.startswith("# ")), p.stem) for p in site.pages}
    pages = "".join(f'<tr><td><a href="{address(p)}">{html.escape(title[p])}</a></td><td><code>{p}</code></td></tr>' for p in site.pages)
    order = _reading_order(site, "index.html")
    return shell(site, "Manual", f"<h1>hullguard: manual</h1><h2>Pages</h2><table class=order>{pages}</table><h2>The library, in reading order</h2>{order}", "index.html", [])


def write(out: Path) -> Site:
    """The whole site."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    site = planned(out.resolve())
    made = {"index.html": index_page(site)} | {address(h.path): header_page(site, h) for h in site.headers} | {address(p): markdown_page(site, p) for p in site.pages}
    for name, text in made.items():
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text(text)
    shutil.copyfile(STYLE, out / "style.css")
    return site


def main() -> int:
    """Write the site, and say what is wrong with what it was made from."""
    out = Path(sys.argv[1])
    site = write(out)
    wrong = complaints(site.headers, out)
    for line in wrong:
        print(line, file=sys.stderr)
    if wrong:
        print(f"docs: {len(wrong)} complaints", file=sys.stderr)
        return 1
    write_to(out.parent / "results" / "docs.json", facts(site.headers, out))
    print(f"  ok  {out}/index.html")
    return 0


if __name__ == "__main__":
    sys.exit(main())
