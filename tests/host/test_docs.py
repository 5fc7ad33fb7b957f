"""Documentation: headers explain what they declare, links lead somewhere, pictures and tables are made by `make figures`, tests that a page names exist.

And the checks themselves: each says what is wrong where something is.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "docs"))

import check  # noqa: E402
import figures  # noqa: E402
import headers  # noqa: E402
import manual  # noqa: E402

PAGES = [ROOT / path for path in manual.markdown_files()]


def header(text: str) -> list[headers.Header]:
    """A header of its own beside the one of statuses."""
    return [headers.read(headers.LIBRARY / "status.h"), headers.parse(headers.LIBRARY / "some.h", f"/** @file\n *  Some. */\n{text}\n")]


def test_headers_and_links_leave_nothing_to_complain_about(tmp_path: Path) -> None:
    made = manual.write(tmp_path)
    assert check.complaints(made.headers, tmp_path) == []
    assert len(made.headers) == len(list(headers.LIBRARY.glob("*.h"))) + 2, "a header that hullguard.h does not list"
    assert sum(i.kind == "function" for h in made.headers for i in h.items) >= 200


def test_every_prototype_of_the_headers_is_read() -> None:
    for path in headers.LIBRARY.glob("*.h"):
        plain = re.sub(r"/\*.*?\*/", "", path.read_text(), flags=re.DOTALL)
        names = set(re.findall(r"^(?:static inline )?[a-z]\w* \**(hg_\w+)\(", plain, re.MULTILINE)) | set(re.findall(r"^\} (hg_\w+);", plain, re.MULTILINE))
        assert names <= {i.name for i in headers.read(path).items}, path.name


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("void hg_some(void);", "nothing says what hg_some is"),
        ("/** A call. */\n\nvoid hg_some(void);", "nothing says what hg_some is"),
        ("/* Some. */\ntypedef struct {\n    int a; /* one */\n    int b;\n} hg_some;", "nothing says what hg_some.b is"),
        ("/* Some. */\ntypedef enum {\n    HG_A = 1,\n    HG_B = 2 /* two */\n} hg_some;", "nothing says what hg_some.HG_A is"),
        ("/** A call.\n *  @retval HG_OK  done\n *  @retval HG_E_SOME  not */\nhg_status hg_some(void);", "hg_some names HG_E_SOME, which is no hg_status"),
        ("/** A call. */\nhg_status hg_some(void);", "hg_some returns a status and names none"),
    ],
)
def test_a_header_that_leaves_something_unsaid_is_told(text: str, said: str) -> None:
    given = header(text)
    assert any(said in line for line in [*check.unexplained(given), *check.unknown_statuses(given)])


def test_an_answer_that_the_header_does_not_name_is_told(tmp_path: Path) -> None:
    given = header("/** A call.\n *  @retval HG_OK  done */\nhg_status hg_some(void);")
    code = tmp_path / "some.c"
    code.write_text("hg_status hg_some(void)\n{\n    if (other() == HG_E_EMPTY) {\n        return HG_OK;\n    }\n    return bad() ? HG_E_SIZE : HG_OK;\n}\n")
    assert [line.split(": ")[1] for line in check.unannounced(given, [code])] == ["hg_some answers HG_E_SIZE, which its header does not name"]


def test_a_header_in_the_style_of_the_library_has_its_words_where_they_belong() -> None:
    given = header("/* Before. */\n#if HG_X\n#define HG_A 1 /* behind */\n#define HG_B 2\n#endif\n\ntypedef struct { /* RAM */\n    hg_some *a; /* [n] */\n} hg_some;\n")
    macro, other, struct = given[1].items
    assert (macro.text, macro.condition, other.follows) == ("Before.\nbehind", "HG_X", True)
    assert (struct.text, struct.members[0].text) == ("RAM", "[n]")
    assert check.unexplained(given) == []


@pytest.mark.parametrize(("body", "said"), [('<a href="no.html">', "leads nowhere"), ('<a href="#no">', "no such anchor"), ('<a id="x"></a><a id="x"></a>', "stands there twice")])
def test_a_broken_link_is_told(tmp_path: Path, body: str, said: str) -> None:
    (tmp_path / "a.html").write_text(body)
    assert said in check.broken_links(tmp_path)[0]


def test_every_picture_is_shown_and_made() -> None:
    there = {p.name for p in figures.PICTURES.iterdir()}
    shown = {Path(to).name for page in PAGES for to in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text())}
    assert there == shown == set(figures.PICTURE) | set(figures.ELSEWHERE)


def test_every_measured_table_is_filled_and_every_one_is_shown() -> None:
    found = [name for page in figures.PAGES for _, name, _ in figures.MEASURED.findall(page.read_text())]
    assert sorted(found) == sorted(figures.TABLES)
    for page in figures.PAGES:
        for block in figures.MEASURED.finditer(page.read_text()):
            assert "    hullguard " in block[0] and block[0].count("\n") > 6, block[2]


def test_a_page_is_stale_when_a_number_in_it_is_another(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    table = figures.Table(("campaign",), ("what",), (("1.5",),))
    monkeypatch.setattr(figures, "TABLES", {"some": lambda: table})
    page.write_text("a\n<!-- measured: some -->\n<!-- end -->\nb\n")
    page.write_text(figures.filled(page))
    assert figures.filled(page) == page.read_text()
    page.write_text(page.read_text().replace("1.5", "1.4"))
    assert figures.filled(page) != page.read_text()


def test_every_test_that_a_page_names_exists() -> None:
    code = "\n".join(f.read_text() for folder in ("unit", "host", "node", "target", "boards") for f in sorted((ROOT / "tests" / folder).iterdir()) if f.suffix in (".c", ".py"))
    text = (ROOT / "host_tools" / "docs" / "guarantee.md").read_text()
    names = re.findall(r"`((?:test_)?[a-z]+(?:_[a-z0-9]+){4,})`", text)
    assert len(names) > 20
    assert [name for name in names if f"{name}(" not in code] == []
