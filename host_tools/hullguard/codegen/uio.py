"""NAME_uio.h and NAME_uio.c: the tables of a model's unknown-input observers with all estimates (uio.h), and of what isolates their faults (isolate.h).

In fixed point estimates and radii are there, isolation is not: it divides data of any ratio.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hullguard.codegen.both import Both, Scaled
from hullguard.codegen.c import banner, comment, fill, float_only, real, reals, scaled, table, unsigned
from hullguard.codegen.trust import by_type, check, check_about, checked
from hullguard.core import trust
from hullguard.core.library import REALS, library
from hullguard.core.native_uio import UioTable
from hullguard.design.arith import nearest32
from hullguard.design.design import Design
from hullguard.design.tables import rows
from hullguard.design.uio_generator import UioDesign, uio_table
from hullguard.design.uio_isolate import Isolation, isolations
from hullguard.model.table import Array


@dataclass(frozen=True)
class _Names:
    """What the C code calls a model."""

    model: str

    @property
    def macro(self) -> str:
        return f"HG_{self.model.upper()}_UIO"

    @property
    def prefix(self) -> str:
        return f"hg_{self.model}_uio"


def emit_uio(design: Design) -> tuple[str, str]:
    """Header and source."""
    names = _Names(design.tables.name)
    every = [isolations(design.model, u) for u in design.uios]
    return _header(design, names, every), _source(design, names, every)


def _both(a: Sequence[float], fixed: Sequence[float] | None) -> Sequence[float]:
    """Numbers, and beside each what it is in fixed point."""
    return a if fixed is None else [Both(x, y) for x, y in zip(a, fixed, strict=True)]


def _matrix(name: str, a: Array, about: str, fixed: Array | None = None) -> list[str]:
    held = [None] * len(a) if fixed is None else rows(fixed)
    numbers = [reals(_both(r, q)) for r, q in zip(rows(nearest32(a)), held, strict=True)]
    return table("hg_real", name, f"{a.shape[0]}][{a.shape[1]}", numbers, about) if a.size else []


def _vector(name: str, a: Array, about: str, fixed: Array | None = None) -> list[str]:
    numbers = _both([float(x) for x in nearest32(a)], None if fixed is None else fixed.tolist())
    return table("hg_real", name, f"{len(a)}", [reals(numbers)], about) if a.size else []


def _float(lines: list[str]) -> list[str]:
    """What fixed point does without."""
    return ["#if !HG_REAL_Q31", *lines, "#endif"] if lines else []


def _held(fixed: UioTable | None, part: str) -> Array | None:
    """An array of the table in fixed point, if there is one."""
    return None if fixed is None else np.asarray(getattr(fixed, part))


def _fixed(u: UioDesign) -> UioTable | None:
    return uio_table(u, "q31") if u.fixed is not None else None


def _reals(u: UioTable, isolated: Sequence[Isolation]) -> str:
    """Memory of one observer and its isolations, in the library's own words: no size is computed twice."""
    own = [f"HG_UIO_REALS({len(u.state)}U, {len(u.signal)}U, {u.estimates}U, {len(u.mode_decay)}U)"]
    return " + ".join(own + [f"HG_ISOLATE_REALS({len(i.table.whole)}U, {i.table.blocks}U)" for i in isolated])


def _header(design: Design, names: _Names, every: Sequence[Sequence[Isolation]]) -> str:
    guard, made = f"HULLGUARD_MODEL_{names.model.upper()}_UIO_H", [uio_table(u) for u in design.uios]
    isolated, estimates = sum(len(i) for i in every), sum(len(u.names) for u in design.uios)
    lines = [
        *banner(design, "its unknown-input observers, all estimates with their radii."),
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        '#include "hullguard/digest_uio.h"',
        '#include "hullguard/isolate.h"',
        '#include "hullguard/uio.h"',
        "",
        *float_only(design.tables),
        f"#define {names.macro}S {len(made)}U /* observers */",
        *_float([f"#define {names.macro}_ISOLATIONS {isolated}U /* estimates of actuators' faults that are told apart from weaker parts */"]),
        f"#define {names.macro}_ESTIMATES {estimates}U /* of all observers, one after another */",
        *_units(design, names),
        *_digests(design, names, every),
        "",
        *comment("Places of the estimates: faults of actuators, of sensors, unknown inputs, states; of each observer in turn."),
        "enum {",
    ]
    place = 0
    for i, u in enumerate(design.uios):
        for name in u.names:
            lines.append(f"    {names.macro}{i + 1}_{name.upper()} = {place},")
            place += 1
    lines[-1] = lines[-1].rstrip(",")
    lines += [
        "};",
        "",
        f"extern const hg_uio_config {names.prefix}_config[{len(made)}];",
        *_float([f"extern const hg_isolate_config {names.prefix}_isolate_config[{isolated}];"] if isolated else []),
        "",
        "/* Memory of all of them. */",
        "typedef struct {",
        f"    hg_uio       uio[{len(made)}];",
        *_float([f"    hg_isolate   isolate[{isolated}];", f"    hg_isolation found[{isolated}];"] if isolated else []),
        f"    hg_real      estimate[{estimates}];",
        f"    hg_real      radius[{estimates}];",
        *_memory(made, every),
        f"}} {names.prefix};",
        "",
        "#if HG_WITH_DIGEST",
        *check_about("the observers' tables"),
        f"hg_status {names.prefix}_check(hg_digest *walk, uint32_t numbers);",
        *_float([*check_about("the tables of what tells causes apart"), f"hg_status {names.prefix}_isolate_check(hg_digest *walk, uint32_t numbers);"] if isolated else []),
        "#endif",
        "",
        "/** Begin, beside a detector of the same model that has just been started.",
        " *  @param[out] self  memory, owned by the caller  @param[in] how  what is known of the plant's motion, as the detector was told",
        " *  @retval HG_OK          ready",
        " *  @retval HG_E_ARGUMENT  a null pointer",
        " *  @retval HG_E_CONFIG    tables contradict one another, or the detector's ring",
        " *  @retval HG_E_DIGEST    tables are not as they were generated */",
        f"hg_status {names.prefix}_start({names.prefix} *self, const hg_detector *detector, hg_start how);",
        "",
        "/** The sample that the detector has just closed: self->estimate, self->radius and self->found are then its.",
        " *  Begins again where the detector did.",
        " *  @retval HG_OK         all have moved on",
        " *  @retval HG_E_NUMERIC  one refused a number that is not finite; see hg_uio_follow() and hg_isolate_step() */",
        f"hg_status {names.prefix}_follow({names.prefix} *self, const hg_detector *detector);",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _digests(design: Design, names: _Names, every: Sequence[Sequence[Isolation]]) -> list[str]:
    """What the tables' digests must be."""
    held = [real for real in REALS if real != "q31" or all(u.fixed is not None for u in design.uios)]
    own = {real: trust.uio_digest(library(real), [uio_table(u, real) for u in design.uios]) for real in held}
    lines = by_type(f"{names.macro}_DIGEST", own, "Digest of the observers' tables, for each number type (digest.h).")
    told = [(uio_table(u), i.table) for u, isolated in zip(design.uios, every, strict=True) for i in isolated]
    if told:
        apart = {real: trust.isolate_digest(library(real), told) for real in REALS if real != "q31"}
        lines += by_type(f"{names.macro}_ISOLATE_DIGEST", apart, "Digest of the tables of what tells their causes apart.")
    return lines


def _checks(design: Design, names: _Names, every: Sequence[Sequence[Isolation]]) -> list[str]:
    isolated = sum(len(i) for i in every)
    lines = check(f"{names.prefix}_check", f"hg_digest_uio(walk, {names.prefix}_config, {len(design.uios)}U, numbers)", f"{names.macro}_DIGEST")
    walked = f"hg_digest_isolate(walk, {names.prefix}_isolate_config, {isolated}U, numbers)"
    more = _float(check(f"{names.prefix}_isolate_check", walked, f"{names.macro}_ISOLATE_DIGEST")[:-1] if isolated else [])
    return ["#if HG_WITH_DIGEST", *(lines if more else lines[:-1]), *more, "#endif", ""]


def _units(design: Design, names: _Names) -> list[str]:
    """What a program needs that reads estimates in fixed point."""
    if design.tables.fixed is None:
        return []
    units = ", ".join(str(x) for u in design.uios if u.fixed is not None for x in u.fixed.units)
    about = "Initialiser of the estimates' units: with HG_REAL_Q31 an estimate or radius x is held as the integer x 2^(31 - unit); a radius of HG_REAL_MAX says nothing."
    return [*comment(about), f"#define {names.macro}_UNITS {{{units}}}"]


def _memory(made: Sequence[UioTable], every: Sequence[Sequence[Isolation]]) -> list[str]:
    """Numbers of all observers and isolations."""

    def summed(isolated: Sequence[Sequence[Isolation]]) -> str:
        return "    hg_real      real[" + " +\n                      ".join(_reals(u, i) for u, i in zip(made, isolated, strict=True)) + "];"

    alone = summed([[]] * len(made))
    return ["#if HG_REAL_Q31", alone, "#else", summed(every), "#endif"] if any(every) else [alone]


def _observer(u: UioDesign, t: UioTable, n: str, signals: Sequence[str]) -> list[str]:
    q = _fixed(u)
    lines = [f"/* ---- Observer {n.removeprefix('observer')}: {', '.join(u.names)} ---- */", ""]
    lines += table("uint8_t", f"{n}_signal", f"{len(t.signal)}", [unsigned(t.signal)], "places of the signals it reads: " + ", ".join(signals[i] for i in t.signal))
    for part, about in (("state", "next state from state"), ("input", "next state from signals"), ("output", "estimates from state"), ("direct", "estimates from signals")):
        lines += _matrix(f"{n}_{part}", getattr(t, part), f"{about}, row-major", _held(q, part))
    lines += table("uint8_t", f"{n}_taps", f"{len(t.taps)}", [unsigned(t.taps)], "lags that are summed one by one, by signal")
    about = "magnitude of the impulse response by two estimates, signal and lag, each with a tail of 0 behind"
    lines += [*comment(f"{n}_weight [{sum(x + 1 for x in t.taps) * t.estimates}]: {about}")]
    lines.append(f"static const hg_real {n}_weight[] = {{")
    held = [None] * len(t.blocks) if q is None else [[x for row in block for x in row] for _, _, block in q.blocks]
    for (first, signal, block), fixed in zip(t.blocks, held, strict=True):
        lines.append(f"    /* estimates from {u.names[first]} on, {signals[t.wide[signal]]} */")
        lines += fill(reals(_both([x for row in block for x in row], fixed)))
    lines += ["};", ""]
    for part, start in (("rest", "after a start within the initial range"), ("moving", "after a start in a moving plant")):
        about = f"radii's part from initial state, disturbance, unknown inputs between samples and rounding, by sample {start}"
        lines += _matrix(f"{n}_{part}", getattr(t, part), about, _held(q, part))
    lines += _vector(f"{n}_bias", t.bias, "the same from then on", _held(q, "bias"))
    lines += table("hg_real", f"{n}_none", f"{t.estimates}", [reals([0.0] * t.estimates)], "no tail of a residual: each mode has its own")
    lines += _vector(f"{n}_mode_decay", t.mode_decay, "what a mode has left after a sample", _held(q, "mode_decay"))
    lines += _matrix(f"{n}_mode_input", t.mode_input, "weight of a radius older than the taps in each mode", _held(q, "mode_input"))
    lines += _matrix(f"{n}_mode_output", t.mode_output, "estimate's radius a unit of each mode", _held(q, "mode_output"))
    lines += _vector(f"{n}_mode_rest", t.mode_rest, "modes after a start within the initial range", _held(q, "mode_rest"))
    return lines + _vector(f"{n}_mode_moving", t.mode_moving, "modes after a start in a moving plant", _held(q, "mode_moving"))


def _config(u: UioDesign, t: UioTable, n: str) -> list[str]:
    q = _fixed(u)
    moved, shown, summed = t.exponents if q is None else (Scaled(0, x) for x in q.exponents)
    exponent = {"state": moved, "input": moved, "output": shown, "direct": shown}
    order, width, estimates = len(t.state), len(t.signal), t.estimates
    shape = {"state": (order, order), "input": (order, width), "output": (estimates, order), "direct": (estimates, width)}
    tied = [f"                  .{part} = {{.rows = {r}U, .cols = {c}U, .exponent = {scaled(exponent[part])}, .data = {n}_{part}}}" for part, (r, c) in shape.items()]
    return [
        f"    {{.actuators = {t.actuators}U, .sensors = {t.sensors}U, .unknown = {t.unknown}U, .states = {t.states}U,",
        f"     .observer = {{.order = {order}U, .residuals = {estimates}U, .width = {width}U, .signal = {n}_signal,",
        *(line + "," for line in tied[:-1]),
        tied[-1] + "},",
        f"     .hull = {{.residuals = {estimates}U, .width = {len(t.wide)}U, .exponent = {scaled(summed)}, .signal = {n}_signal,",
        f"              .taps = {n}_taps, .weight = {n}_weight, .settle = {len(t.rest)}U, .rest = {n}_rest, .rest_left = {n}_none,",
        f"              .moving = {n}_moving, .moving_left = {n}_none, .bias = {n}_bias,",
        f"              .ready_rest = {t.ready_rest}U, .ready_moving = {t.ready_moving}U,",
        f"              .decay = {n}_none,",
        f"              .modes = {len(t.mode_decay)}U, .mode_decay = {n}_mode_decay, .mode_input = {n}_mode_input, .mode_output = {n}_mode_output,",
        f"              .mode_rest = {n}_mode_rest, .mode_moving = {n}_mode_moving}}}},",
    ]


def _isolate(i: Isolation, n: str, estimates: int) -> tuple[list[str], list[str]]:
    """Tables, and the entry of the configuration."""
    t = i.table
    lines = _matrix(f"{n}_whole", t.whole, "force of the whole of each part from the estimates: " + ", ".join(i.names[1 : 1 + len(t.whole)]))
    lines += _vector(f"{n}_excitation", t.excitation, "smallest scatter of that force that says something")
    if t.sensor:
        lines += table("uint8_t", f"{n}_sensor", f"{len(t.sensor)}", [unsigned(t.sensor)], "rows of sensors' faults")
        lines += table("hg_real", f"{n}_sensor_limit", f"{len(t.sensor)}", [reals(t.sensor_limit)], "smallest magnitude of them that counts")
    numbers = [float(nearest32(x)) for x in (t.limit, t.low_pass, t.explained, t.steady)]  # type: ignore[arg-type]
    sensor = (f"{n}_sensor", f"{n}_sensor_limit") if t.sensor else ("NULL", "NULL")
    return lines, [
        f"    {{.estimates = {estimates}U, .actuator = {t.actuator}U, .limit = {real(numbers[0])},",
        f"     .sensors = {len(t.sensor)}U, .sensor = {sensor[0]}, .sensor_limit = {sensor[1]},",
        f"     .components = {len(t.whole)}U, .whole = {n}_whole, .excitation = {n}_excitation,",
        f"     .low_pass = {real(numbers[1])}, .settle = {t.settle}U, .release = {t.release}U, .block = {t.block}U, .blocks = {t.blocks}U,",
        f"     .explained = {real(numbers[2])}, .steady = {real(numbers[3])}}},",
    ]


def _source(design: Design, names: _Names, every: Sequence[Sequence[Isolation]]) -> str:
    signals = [s.name for s in design.model.signals]
    lines = [*banner(design, "tables of its unknown-input observers."), f'#include "{names.model}_uio.h"', "", "#include <stddef.h>", ""]
    configs: list[str] = []
    for k, u in enumerate(design.uios):
        t = uio_table(u)
        lines += _observer(u, t, f"observer{k + 1}", signals)
        configs += _config(u, t, f"observer{k + 1}")
    isolating: list[str] = []
    entries: list[str] = []
    for k, (u, isolated) in enumerate(zip(design.uios, every, strict=True)):
        for j, i in enumerate(isolated):
            own, entry = _isolate(i, f"isolate{k + 1}_{j + 1}", len(u.names))
            isolating, entries = isolating + own, entries + entry
    lines += [f"const hg_uio_config {names.prefix}_config[{len(design.uios)}] = {{", *configs, "};", ""]
    if entries:
        isolating += [f"const hg_isolate_config {names.prefix}_isolate_config[{sum(len(i) for i in every)}] = {{", *entries, "};"]
        lines += [*_float(isolating), ""]
    return "\n".join(lines + _checks(design, names, every) + _start(design, names, every) + [""] + _follow(design, names, every)) + "\n"


def _start(design: Design, names: _Names, every: Sequence[Sequence[Isolation]]) -> list[str]:
    lines = [
        f"hg_status {names.prefix}_start({names.prefix} *self, const hg_detector *detector, hg_start how)",
        "{",
        "    if ((self == NULL) || (detector == NULL)) {",
        "        return HG_E_ARGUMENT;",
        "    }",
        *checked(f"{names.prefix}_check"),
        *_float(
            [
                "#if HG_WITH_DIGEST",
                "    hg_digest_start(&walk);",
                f"    const hg_status told = {names.prefix}_isolate_check(&walk, UINT32_MAX);",
                "    if (told != HG_OK) {",
                "        return told;",
                "    }",
                "#endif",
            ]
            if any(every)
            else []
        ),
        "    hg_real *memory = self->real;",
        "    hg_status status = HG_OK;",
    ]
    count = 0
    for k, (u, isolated) in enumerate(zip(design.uios, every, strict=True)):
        t = uio_table(u)
        lines += [
            "    if (status == HG_OK) {",
            f"        status = hg_uio_start(&self->uio[{k}], &{names.prefix}_config[{k}], &detector->radii, how, memory);",
            f"        memory = &memory[{_reals(t, [])}];",
            "    }",
        ]
        begun = []
        for i in isolated:
            begun += [
                "    if (status == HG_OK) {",
                f"        status = hg_isolate_start(&self->isolate[{count}], &{names.prefix}_isolate_config[{count}], memory);",
                f"        memory = &memory[HG_ISOLATE_REALS({len(i.table.whole)}U, {i.table.blocks}U)];",
                "    }",
            ]
            count += 1
        lines += _float(begun)
    return [*lines, "    (void)memory;", "    return status;", "}"]


def _follow(design: Design, names: _Names, every: Sequence[Sequence[Isolation]]) -> list[str]:
    lines = [f"hg_status {names.prefix}_follow({names.prefix} *self, const hg_detector *detector)", "{"]
    if any(every):
        lines += _float(["    const bool again = self->uio[0].beginnings != detector->beginnings;"])
    lines += ["    hg_status status = HG_OK;", "    hg_status own;"]
    if any(every):
        lines += _float([f"    for (uint8_t i = 0U; again && (i < {names.macro}_ISOLATIONS); i++) {{", "        hg_isolate_reset(&self->isolate[i]);", "    }"])
    place = count = 0
    for k, (u, isolated) in enumerate(zip(design.uios, every, strict=True)):
        lines += [
            f"    own = hg_uio_follow(&self->uio[{k}], detector, &self->estimate[{place}], &self->radius[{place}]);",
            "    status = (own == HG_OK) ? status : own;",
        ]
        told = []
        for _ in isolated:
            told += [
                f"    own = hg_isolate_step(&self->isolate[{count}], &self->estimate[{place}], &self->radius[{place}], &self->found[{count}]);",
                "    status = (own == HG_OK) ? status : own;",
            ]
            count += 1
        lines += _float(told)
        place += len(u.names)
    return [*lines, "    return status;", "}"]
