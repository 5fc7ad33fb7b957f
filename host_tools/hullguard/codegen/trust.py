"""What generated files know of their own tables: digest, self-test and freeze frame."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

from hullguard.core.native import REST
from hullguard.core.trust import Drive
from hullguard.design.tables import FreezeTable

WIDTH = 140  # columns
TYPES = (("q31", "HG_REAL_Q31"), ("f64", "HG_REAL_F64"), ("f32", "HG_REAL_F32"))


def by_type(macro: str, digests: Mapping[str, int], about: str) -> list[str]:
    """A macro with a value for each number type that there is one for."""
    lines = [f"/* {about} */"]
    for real, option in TYPES:
        if real in digests:
            lines += [f"{'#if' if len(lines) == 1 else '#elif'} {option}", f"#define {macro} 0x{digests[real]:08X}UL"]
    return [*lines, "#endif"]


def head(macro: str, crc: int) -> list[str]:
    """The same for every number type: it holds no number of a table."""
    return [f"#define {macro}_HEAD 0x{crc:08X}UL /* of it, how many tables there are */"]


def check_about(what: str) -> list[str]:
    """Comment of NAME_check()."""
    return [
        f"/** Take the next numbers of {what} and compare their digest (digest.h): for a walk in the background.",
        " *  The start does it at once.",
        " *  @param[in,out] walk  begun by hg_digest_start()  @param[in] numbers  how many, >= 1",
        " *  @retval HG_OK        that was the last one, and all is as generated",
        " *  @retval HG_E_BUSY    there are more",
        " *  @retval HG_E_DIGEST  that was the last one, and something is not */",
    ]


def check(function: str, walked: str, digest: str) -> list[str]:
    """NAME_check(): `walked` takes (walk, numbers)."""
    return [
        f"hg_status {function}(hg_digest *walk, uint32_t numbers)",
        "{",
        f"    const hg_status result = {walked};",
        f"    return ((result == HG_OK) && (walk->crc != {digest})) ? HG_E_DIGEST : result;",
        "}",
        "",
    ]


def checked(function: str) -> list[str]:
    """The beginning of a start that looks at its tables first."""
    return [
        "#if HG_WITH_DIGEST",
        "    hg_digest walk;",
        "    hg_digest_start(&walk);",
        f"    const hg_status checked = {function}(&walk, UINT32_MAX);",
        "    if (checked != HG_OK) {",
        "        return checked;",
        "    }",
        "#endif",
    ]


def freeze_storage(f: FreezeTable | None, width: int, residuals: int) -> list[str]:
    """Members of a node's memory."""
    if f is None:
        return []
    return ["    hg_freeze   freeze;", f"    hg_freeze_row frozen[{f.samples}];", f"    hg_real     frozen_real[{f.samples}U * HG_FREEZE_REALS({width}U, {residuals}U)];"]


def freeze_config(f: FreezeTable | None) -> list[str]:
    """Behind its two messages, which are called as they are."""
    if f is None:
        return []
    return [
        "/* freeze: the samples before and after a confirmed alarm */",
        f"static const hg_freeze_config freeze = {{.samples = {f.samples}U, .after = {f.after}U, .burst = {f.burst}U,",
        f"                                        .request = &{f.request.name}, .response = &{f.response.name}}};",
        "",
    ]


def selftest_about(t: str) -> list[str]:
    """Prototype of NAME_selftest()."""
    return [
        "/** Self-test of tables, library and processor (selftest.h) in the node's own memory, before its start: a stored drive,",
        " *  fault-free and then with a fault that must be found, every bit of whose outcome was computed when the model was designed.",
        " *  @param[out] self  memory, owned by the caller; not started afterwards",
        " *  @retval HG_OK          all as it was then",
        " *  @retval HG_E_SELFTEST  something is not",
        " *  @retval HG_E_EMPTY     for this model no drive was found: nothing was tested",
        " *  @retval HG_E_ARGUMENT, HG_E_CONFIG, HG_E_DIGEST  as the start */",
        f"hg_status {t}_selftest({t}_node *self);",
        "",
    ]


def selftest(t: str, prefix: str, found: tuple[Drive, Mapping[str, int]] | None) -> list[str]:
    """NAME_selftest()."""
    head = ["", f"hg_status {t}_selftest({t}_node *self)", "{"]
    if found is None:
        return [*head, "    (void)self;", "    return HG_E_EMPTY;", "}"]
    drive, digests = found
    start = "HG_START_REST" if drive.start == REST else "HG_START_MOVING"
    return [
        "",
        *by_type("SELFTEST", digests, "what the self-test's drive must give"),
        *head,
        *wrapped(f"    static const int32_t code[{prefix}_SIGNALS] = {{{', '.join(str(c) for c in drive.code)}}}; /* at rest */"),
        "    static const hg_selftest_config drive = {",
        f"        .how = {start}, .samples = {drive.samples}U, .fault = {drive.fault}U, .signal = {drive.signal}U, .spread = {drive.spread}U,",
        f"        .size = {drive.size}, .code = code, .digest = SELFTEST,",
        "    };",
        f"    const hg_status result = {t}_node_start(self, drive.how);",
        "    return (result == HG_OK) ? hg_selftest_run(&self->node, &drive) : result;",
        "}",
    ]


def wrapped(line: str) -> Sequence[str]:
    """A line, or several."""
    return textwrap.wrap(line, WIDTH, subsequent_indent=" " * 8, break_long_words=False, break_on_hyphens=False, drop_whitespace=True)
