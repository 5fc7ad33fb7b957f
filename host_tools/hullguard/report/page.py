"""One self-contained HTML file: shell, tables, and figures as inline SVG whose colours follow the reader's light or dark scheme."""

from __future__ import annotations

import html
import io
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

# name: (light, dark). A figure is drawn in the light colours; on the page each becomes a variable. Okabe and Ito's palette, colour-blind safe.
THEME = {
    "ink": ("#1b1f24", "#e9ebee"),
    "muted": ("#5f6770", "#a3abb4"),
    "grid": ("#dfe2e6", "#343a41"),
    "edge": ("#9aa2ab", "#6d757e"),
    "blue": ("#0072b2", "#5db7ea"),
    "sky": ("#56b4e8", "#3b86b4"),
    "green": ("#00805e", "#2cc79b"),
    "red": ("#c64600", "#ff8a4c"),
    "pink": ("#b3528a", "#e59ac4"),
    "amber": ("#a96f00", "#f0b53e"),
}
INK, MUTED, GRID, EDGE, BLUE, SKY, GREEN, RED, PINK, AMBER = (light for light, _ in THEME.values())

RC: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "hullguard",
    "path.simplify": False,
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.edgecolor": EDGE,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": EDGE,
    "ytick.color": EDGE,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "axes.unicode_minus": True,
}

CSS = """
:root{color-scheme:light dark;--paper:#fff;--soft:#f4f6f8;--good:#00684c;--bad:#b03a00;VARS_LIGHT}
@media screen and (prefers-color-scheme:dark){:root{--paper:#15181c;--soft:#1e2328;--good:#45d3a8;--bad:#ff9a63;VARS_DARK}}
*{box-sizing:border-box}
body{margin:0;background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
main{max-width:1080px;margin:0 auto;padding:20px 20px 48px}
h1{font-size:1.5rem;line-height:1.25;margin:.2rem 0 .3rem}
h2{font-size:1.15rem;margin:2.2rem 0 .4rem;padding-top:.7rem;border-top:1px solid var(--grid)}
h3{font-size:1rem;margin:1.3rem 0 .3rem}
p{margin:.4rem 0 .7rem;max-width:52rem}
.lead{font-size:1.08rem;max-width:none}
.note,figcaption,caption{color:var(--muted);font-size:.88rem}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(132px,1fr));gap:10px;margin:1rem 0}
.tile{background:var(--soft);border-radius:8px;padding:10px 12px;border-left:4px solid var(--edge)}
.tile.good{border-left-color:var(--good)}.tile.bad{border-left-color:var(--bad)}
.tile b{display:block;font-size:1.3rem;line-height:1.3;white-space:nowrap;font-variant-numeric:tabular-nums}
.tile span{display:block;color:var(--muted);font-size:.82rem;line-height:1.35}
.wide{overflow-x:auto;margin:.5rem 0 .8rem}
table{border-collapse:collapse;font-size:.88rem;font-variant-numeric:tabular-nums}
caption{text-align:left;padding:0 0 .3rem}
th,td{padding:4px 14px 4px 0;text-align:left;vertical-align:top;border-bottom:1px solid var(--grid)}
th{font-weight:600;color:var(--muted);vertical-align:bottom}
th.n,td.n{text-align:right}td.n{white-space:nowrap}
td.good{color:var(--good)}td.bad{color:var(--bad);font-weight:600}
table.matrix{font:12px/1.45 ui-monospace,"DejaVu Sans Mono",Consolas,monospace;border-left:2px solid var(--edge);border-right:2px solid var(--edge)}
table.matrix td{border:0;padding:0 8px;text-align:right;white-space:nowrap}
.matrices{display:flex;flex-wrap:wrap;gap:12px 28px;margin:.5rem 0}
.matrices div{max-width:100%;overflow-x:auto}
.matrices h4{margin:0 0 2px;font-size:.85rem;font-weight:600}
.matrices h4 span{color:var(--muted);font-weight:400}
figure{margin:.6rem 0 1rem}
figure>div{overflow-x:auto}
svg{display:block;width:100%;min-width:700px;height:auto}
svg text{font-family:"DejaVu Sans",Verdana,system-ui,sans-serif}
code{font:.9em ui-monospace,"DejaVu Sans Mono",Consolas,monospace;overflow-wrap:anywhere}
details{margin:.6rem 0}summary{cursor:pointer;color:var(--blue)}
aside{background:var(--soft);border-left:4px solid var(--blue);border-radius:8px;padding:8px 14px;margin:1rem 0}
aside p{margin:.2rem 0;max-width:none}
@media (max-width:600px){main{padding:14px 12px 32px}body{font-size:14px}h1{font-size:1.25rem}.tiles{grid-template-columns:1fr 1fr}}
@media print{@page{size:A4;margin:14mm}main{max-width:none;padding:0}body{font-size:10.5pt}svg{min-width:0}.tiles{grid-template-columns:repeat(4,1fr)}
figure,.tile,tr,aside{break-inside:avoid}h2,h3{break-after:avoid}.wide,figure>div{overflow:visible}}
"""


def esc(value: object) -> str:
    """Text for HTML."""
    return html.escape(str(value), quote=True)


def num(value: float | None, digits: int = 3) -> str:
    """A number as people write it; a dash where there is none."""
    if value is None or math.isnan(value):
        return "–"
    if value in (float("inf"), float("-inf")):
        return "∞" if value > 0 else "−∞"
    if float(value).is_integer() and abs(value) < 1e7:
        return f"{int(value)}".replace("-", "−")
    return f"{value:.{digits}g}".replace("-", "−")


def percent(part: float | None, digits: int = 3) -> str:
    """A share in per cent."""
    return "–" if part is None or math.isnan(part) else f"{num(100 * part, digits)}\u00a0%"


def plural(count: int, what: str) -> str:
    """A count with its noun."""
    return f"{count} {what}" + ("" if count == 1 else "s")


class Cell:
    """A table cell with a class: good or bad."""

    def __init__(self, text: str, kind: str) -> None:
        """Text and class."""
        self.text, self.kind = text, kind


def table(header: Sequence[str], rows: Iterable[Sequence[object]], caption: str = "") -> str:
    """A table. A heading that begins with '#' is a column of numbers; a float or an int is written by num()."""
    numeric = [h.startswith("#") for h in header]
    lines = ['<div class="wide"><table>']
    if caption:
        lines.append(f"<caption>{esc(caption)}</caption>")
    right = ("", ' class="n"')
    heads = "".join(f"<th{right[n]}>{esc(h.lstrip('#'))}</th>" for h, n in zip(header, numeric, strict=True))
    lines.append(f"<thead><tr>{heads}</tr></thead><tbody>")
    for row in rows:
        cells = []
        for value, is_number in zip(row, numeric, strict=True):
            kinds = ["n"] if is_number else []
            if isinstance(value, Cell):
                kinds.append(value.kind)
                text = value.text
            else:
                text = num(float(value)) if isinstance(value, (int, float)) and not isinstance(value, bool) else "–" if value is None else str(value)
            mark = f' class="{" ".join(kinds)}"' if kinds else ""
            cells.append(f"<td{mark}>{esc(text)}</td>")
        lines.append(f"<tr>{''.join(cells)}</tr>")
    lines.append("</tbody></table></div>")
    return "\n".join(lines)


def tile(label: str, value: str, more: str = "", kind: str = "") -> str:
    """One figure of the summary."""
    return f'<div class="tile {esc(kind)}"><span>{esc(label)}</span><b>{esc(value)}</b><span>{esc(more)}</span></div>'


def svg(figure: Figure, name: str, label: str) -> str:
    """A figure as inline SVG: no identifiers shared with others, no address in it, theme colours as variables."""
    buffer = io.StringIO()
    FigureCanvasSVG(figure)
    with mpl.rc_context(RC):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None}, transparent=True)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r'\s(xmlns(:xlink)?|version)="[^"]*"', "", text)
    text = text.replace("xlink:href", "href")
    text = re.sub(r'(\bid="|\bhref="#|url\(#)', rf"\g<1>{name}-", text)
    text = re.sub(r' d="([^"]*)"', lambda m: f' d="{_short(m[1])}"', text)
    text = re.sub(r"<svg[^>]*?viewBox=\"([^\"]*)\"[^>]*>", rf'<svg viewBox="\g<1>" role="img" aria-label="{esc(label)}">', text, count=1)
    for key, (light, _) in THEME.items():
        text = text.replace(light, f"var(--{key})")
    return re.sub(r"\n\s*", "\n", text).strip()


def _short(path: str) -> str:
    """Path data with hundredths of a point; long curves with tenths, which no screen shows."""
    places = 1 if len(path) > 6000 else 2
    rounded = re.sub(r"-?\d+\.\d+", lambda m: f"{float(m[0]):.{places}f}".rstrip("0").rstrip("."), path)
    return re.sub(r"\s+", " ", rounded).strip()


def picture(figure: Figure, name: str, label: str, caption: str) -> str:
    """A figure with its caption; on a narrow screen it scrolls sideways by itself."""
    return f"<figure><div>{svg(figure, name, label)}</div><figcaption>{esc(caption)}</figcaption></figure>"


def page(title: str, body: Iterable[str]) -> str:
    """The whole file."""
    light = ";".join(f"--{k}:{v[0]}" for k, v in THEME.items())
    dark = ";".join(f"--{k}:{v[1]}" for k, v in THEME.items())
    css = CSS.replace("VARS_LIGHT", light).replace("VARS_DARK", dark).strip()
    head = f'<meta charset="utf-8">\n<meta name="viewport" content="width=device-width,initial-scale=1">\n<title>{esc(title)}</title>\n<style>\n{css}\n</style>'
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n<main>\n' + "\n".join(body) + "\n</main>\n</body>\n</html>\n"
