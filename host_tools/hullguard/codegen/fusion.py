"""NAME.h, NAME.c, NAME_config.h and NAME.dbc of a model of kind "fusion"."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from hullguard.codegen.c import _field, _message, _protection, _scale, _strings, banner, comment, present, real, reals, table, unsigned
from hullguard.codegen.dbc import BASIS, BUS, DETECTOR, FAULT, FLAG, PLANT, Entry, Message, _entry, _header, _numbered, _symbol, dbc_text
from hullguard.codegen.names import LIBRARY, UNITS, identifiers
from hullguard.codegen.trust import by_type, check, check_about, checked, head
from hullguard.core import trust
from hullguard.core.library import library
from hullguard.core.tracker import TrackerNative
from hullguard.design.fusion_model import EstimateTable, FusionDesign, FusionTables, SourceTable
from hullguard.design.tables import SignalTable
from hullguard.errors import InputError

BUS_SENSORS = 8  # with links of their own in a verdict


def unit_of(name: str) -> str:
    """Unit that a state's or a sensor's name ends with; also under a deviation's."""
    return UNITS.get(name.removesuffix("_deviation").rpartition("_")[2], "")


# --- C -------------------------------------------------------------------------------------------------------------------------------------


def emit_c(made: FusionDesign) -> tuple[str, str]:
    """Text of NAME.h and NAME.c."""
    if made.tables.name in LIBRARY:
        raise InputError(f"model name '{made.tables.name}': the library has a header of that name, and generated files would clash with it; rename the model")
    identifiers("sensors and states", [*made.model.names, *made.model.plant.states])
    return _c_header(made), _c_source(made)


def _places(prefix: str, about: str, names: Sequence[str], notes: Sequence[str]) -> list[str]:
    width = max(len(n) for n in names)
    last = len(names) - 1
    lines = [f"    {prefix}{n.upper():<{width}} = {i}{',' if i < last else ' '} /* {note} */" for i, (n, note) in enumerate(zip(names, notes, strict=True))]
    return [*comment(about), "enum {", *lines, "};", ""]


def _c_header(made: FusionDesign) -> str:
    t, model = made.tables, made.model
    macro, prefix, guard = f"HG_{t.name.upper()}", f"hg_{t.name}", f"HULLGUARD_MODEL_{t.name.upper()}_H"
    slots = f"({macro}_DEPTH + 1U)"
    frames = [f"0x{s.message.id:X}, {unit_of(s.name) or 'no unit'}" for s in t.source]
    judged = [
        f"    hg_consistency_sum    sum[{macro}_ONSETS * {macro}_SENSORS];",
        f"    hg_consistency_sensor judged[{macro}_SENSORS];",
        f"    hg_real               response[HG_CONSISTENCY_REALS({macro}_STATES, {macro}_SENSORS, {macro}_ONSETS)];",
    ]
    lines = [
        *banner(made, "a fusion filter on a bus: its places, constants and storage."),
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        '#include "hullguard/digest_tracker.h"',
        '#include "hullguard/tracker.h"',
        "",
        f"#if HG_FUSION_STATES_MAX < {t.states}U",
        f'#error "model {t.name} needs HG_FUSION_STATES_MAX of at least {t.states}"',
        "#endif",
        f"#if HG_FUSION_SENSORS_MAX < {t.sensors}U",
        f'#error "model {t.name} needs HG_FUSION_SENSORS_MAX of at least {t.sensors}"',
        "#endif",
        "#if HG_REAL_Q31",
        f'#error "model {t.name}: a fusion filter has no fixed-point form; build the library for float32"',
        "#endif",
        "",
        "#ifdef __cplusplus",
        'extern "C" {',
        "#endif",
        "",
        f"#define {macro}_STATES {t.states}U",
        f"#define {macro}_SENSORS {t.sensors}U",
        f"#define {macro}_DEPTH {t.depth}U",
        *([f"#define {macro}_ONSETS {t.judge.onsets}U"] if t.judge else []),
        f"#define {macro}_SAMPLE_TIME_US {round(model.sample_time_s * 1e6)}UL /* microseconds between two ticks */",
        f"#define {macro}_HASH 0x{t.hash:08X}UL /* changes with any number of the tables */",
        *by_type(f"{macro}_DIGEST", trust.tracker_digests(t), "Digest of the tables, for each number type (digest.h)."),
        *head(f"{macro}_DIGEST", trust.tracker_head(TrackerNative(library(), t))),
        "",
        *_places(f"{macro}_STATE_", "States.", model.plant.states, [unit_of(s) or "no unit" for s in model.plant.states]),
        *_places(f"{macro}_SENSOR_", "Sensors: bits of a verdict's candidates.", model.names, frames),
        "/* Initialisers of arrays of names, for programs that talk to people. */",
        *_strings(f"{macro}_SENSOR_NAMES", model.names),
        *_strings(f"{macro}_STATE_NAMES", model.plant.states),
        "",
        "/* Constants of every node. */",
        f"extern const hg_tracker_config {prefix}_config;",
        "",
        "/* Memory of one node's copy of the filter. */",
        "typedef struct {",
        "    hg_tracker            tracker;",
        f"    hg_fusion_slot        slot[{macro}_DEPTH + 1U];",
        f"    hg_fusion_entry       entry[{slots} * {macro}_SENSORS];",
        f"    hg_fusion_sensor      sensor[{macro}_SENSORS];",
        f"    hg_fusion_record      record[{macro}_SENSORS];",
        f"    int32_t               origin[{macro}_STATES];",
        f"    hg_real               real[HG_FUSION_REALS({macro}_STATES, 0U, {macro}_SENSORS, {macro}_DEPTH)];",
        *(judged if t.judge else []),
        f"    hg_link               link[{macro}_SENSORS + 1U];",
        f"    hg_real               estimate[2U * {macro}_STATES];",
        f"}} {prefix}_tracker;",
        "",
        "#if HG_WITH_DIGEST",
        *check_about("the model's tables"),
        f"hg_status {prefix}_check(hg_digest *walk, uint32_t numbers);",
        "#endif",
        "",
        "/** Start a node; self->tracker is then ready for hg_tracker_receive().",
        " *  @param[out] self  memory, owned by the caller  @param[in] how  as hg_tracker_start()",
        " *  @retval HG_OK          ready",
        " *  @retval HG_E_ARGUMENT  a null pointer",
        " *  @retval HG_E_CONFIG    tables contradict one another: these tables are not of this library",
        " *  @retval HG_E_DIGEST    tables are not as they were generated */",
        f"hg_status {prefix}_tracker_start({prefix}_tracker *self, hg_start how);",
        "",
        "#ifdef __cplusplus",
        "}",
        "#endif",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _matrix(name: str, rows: Sequence[Sequence[float]], about: str) -> list[str]:
    return table("hg_real", name, f"{len(rows)}][{len(rows[0])}", [reals(r) for r in rows], about) if rows and rows[0] else []


def _vector(name: str, values: Sequence[float], about: str) -> list[str]:
    return table("hg_real", name, f"{len(values)}", [reals(values)], about)


def _filter(t: FusionTables, names: Sequence[str]) -> list[str]:
    lines = ["/* ---- Plant and sensors ---- */", ""]
    lines += [*_matrix("plant", t.A, "A, row-major"), *_matrix("noise", t.Q, "Q, row-major")]
    lines += [*_vector("initial", t.x0, "estimate before the first sample"), *_matrix("initial_covariance", t.P0, "its covariance, row-major")]
    if t.select:
        lines += table("uint8_t", "select", f"{t.sensors}", [unsigned(t.select)], "state that each sensor sees: " + ", ".join(names))
    else:
        lines += _matrix("sees", t.C, "C, a row a sensor: " + ", ".join(names))
    lines += [*_vector("variance", t.R, "R"), *_vector("range", t.range, "largest |y| about the local origin, signal units")]
    lines += _vector("origin_step", t.origin, "steps of the local origin, signal units; 0: none") if t.origin else []
    lines += ["/* ---- Triggers, by the set of sensors alive ---- */", ""]
    for k, each in enumerate(t.table):
        lines += _vector(f"level{k + 1}", each.level, f"thresholds while sensors {each.alive:#x} are alive")
        lines += _matrix(f"relax{k + 1}", each.relax, "1 / beta - 1 by loss rate and sensor; negative: silence says nothing")
        lines += _matrix(f"early{k + 1}", each.early, "the same while a frame may be on its way") if t.delay else []
    lines += [*comment(f"trigger_table [{len(t.table)}]"), "static const hg_fusion_table trigger_table[] = {"]
    early = [f"early{k + 1}" if t.delay else "NULL" for k in range(len(t.table))]
    lines += [f"    {{.alive = 0x{each.alive:X}U, .level = level{k + 1}, .relax = relax{k + 1}, .early = {early[k]}}}," for k, each in enumerate(t.table)]
    modulus = t.source[0].message.protection.modulus
    return [
        *lines,
        "};",
        "",
        "static const hg_fusion_config filter = {",
        f"    .states = {t.states}U, .inputs = 0U, .sensors = {t.sensors}U, .depth = {t.depth}U, .delay = {t.delay}U,",
        f"    .heartbeat = {t.heartbeat_sensor}U, .watchdog = {t.watchdog}U, .modulus = {modulus}U, .trigger = HG_FUSION_{t.trigger.upper()},",
        f"    .A = plant, .B = NULL, .Q = noise, .x0 = initial, .P0 = initial_covariance, .select = {present('select', t.select)},",
        f"    .C = {'NULL' if t.select else 'sees'}, .R = variance, .range = range, .huber = {real(t.huber)}, .origin = {present('origin_step', t.origin)},",
        f"    .rates = {t.rates}U, .rate_step = {real(t.rate_step)}, .loss = {real(t.loss)}, .smoothing = {real(t.smoothing)},",
        f"    .tables = {len(t.table)}U, .table = trigger_table,",
        "};",
        "",
    ]


def _judge(t: FusionTables) -> list[str]:
    j = t.judge
    if j is None:
        return []
    return [
        *_vector("least_bias", j.least, "smallest bias of each sensor that is looked for, signal units"),
        "static const hg_consistency_config judge = {",
        f"    .onsets = {j.onsets}U, .stride = {j.stride}U, .least = least_bias, .limit = {real(j.limit)}, .confirm = {j.confirm}U,",
        f"    .repeats = {j.repeats}U, .rest = {j.rest}U,",
        "};",
        "",
    ]


def _signals(n: str, signals: Iterable[SignalTable]) -> list[str]:
    """Scales and fields of one message."""
    every = list(signals)
    lines = [f"static const hg_code_scale {n}_scale[] = {{", *(line for s in every for line in _scale(s)), "};", ""]
    return [*lines, f"static const hg_field {n}_field[] = {{", *(_field(s) for s in every), "};", ""]


def _sources(sources: Sequence[SourceTable]) -> list[str]:
    lines = ["/* ---- Frames ---- */", ""]
    for s in sources:
        lines += [*_signals(s.name, [s.signal]), *_protection(s.message.protection, s.name)]
    lines += [*comment(f"sensor_message [{len(sources)}]"), "static const hg_message sensor_message[] = {"]
    for s in sources:
        lines += _message(s.message, s.name, 1)
    lines += ["};", "", "static const hg_tracker_source source[] = {"]
    lines += [f"    {{.message = &sensor_message[{i}], .wraps = {'true' if s.wraps else 'false'}}}, /* {s.name} */" for i, s in enumerate(sources)]
    return [*lines, "};", ""]


def _estimates(estimates: Sequence[EstimateTable]) -> list[str]:
    lines: list[str] = []
    for e in estimates:
        lines += [*_signals(e.message.name, e.signals), *_protection(e.message.protection, e.message.name)]
    lines += [*comment(f"estimate [{len(estimates)}]: a frame a state"), "static const hg_message estimate[] = {"]
    for e in estimates:
        lines += _message(e.message, e.message.name, 2)
    return [*lines, "};", ""]


def _c_source(made: FusionDesign) -> str:
    t, prefix = made.tables, f"hg_{made.tables.name}"
    lines = [*banner(made, "tables of a fusion filter on a bus."), f'#include "{t.name}.h"', "", "#include <stddef.h>", ""]
    lines += [*_filter(t, made.model.names), *_judge(t), *_sources(t.source), *_estimates(t.estimate)]
    for n, m in (("tick", t.tick), ("verdict", t.verdict), ("status", t.status)):
        body = _message(m, n, 0, "")
        lines += [*_protection(m.protection, n), f"static const hg_message {n} = {body[0]}", "   " + body[1].removesuffix(",") + ";", ""]
    lines += [
        f"const hg_tracker_config {prefix}_config = {{",
        f"    .fusion = &filter, .consistency = {'&judge' if t.judge else 'NULL'}, .source = source, .tick = &tick, .verdict = &verdict, .status = &status,",
        f"    .estimate = estimate, .heartbeat = {t.heartbeat}U, .interval = {t.interval}U, .model_hash = HG_{t.name.upper()}_HASH,",
        "};",
        "",
        "#if HG_WITH_DIGEST",
        *check(f"{prefix}_check", f"hg_digest_tracker(walk, &{prefix}_config, HG_{t.name.upper()}_DIGEST_HEAD, numbers)", f"HG_{t.name.upper()}_DIGEST")[:-1],
        "#endif",
        "",
        f"hg_status {prefix}_tracker_start({prefix}_tracker *self, hg_start how)",
        "{",
        "    if (self == NULL) {",
        "        return HG_E_ARGUMENT;",
        "    }",
        *checked(f"{prefix}_check"),
        "    const hg_tracker_memory memory = {",
        "        .fusion = {.slot = self->slot, .entry = self->entry, .sensor = self->sensor, .record = self->record, .origin = self->origin, .real = self->real},",
        *(["        .consistency = {.sum = self->sum, .sensor = self->judged, .real = self->response},"] if t.judge else []),
        "        .link = self->link,",
        "        .real = self->estimate,",
        "    };",
        f"    return hg_tracker_start(&self->tracker, &{prefix}_config, &memory, how);",
        "}",
    ]
    return "\n".join(lines) + "\n"


def emit_config(made: FusionDesign) -> str:
    """Text of NAME_config.h: a library with what this model needs and no more."""
    t = made.tables
    guard = f"HULLGUARD_MODEL_{t.name.upper()}_CONFIG_H"
    least = {"HG_GROUPS_MAX": 1, "HG_GROUP_SIGNALS_MAX": 2, "HG_LEVELS_MAX": 1, "HG_GENERATORS_MAX": 1, "HG_FUSION_STATES_MAX": t.states, "HG_FUSION_SENSORS_MAX": t.sensors}
    lines = [*banner(made, "what it needs of the library, for HG_CONFIG_HEADER."), f"#ifndef {guard}", f"#define {guard}", ""]
    lines += [f"#define {name} {number}U" for name, number in least.items()]
    lines += [f"#define HG_WITH_{part} 0" for part in ("ZONOTOPE", "BANK", "PREDICT", "MISMATCH", "FREEZE")]
    return "\n".join([*lines, "", "#endif"]) + "\n"


# --- DBC -----------------------------------------------------------------------------------------------------------------------------------


def _cycle_ms(made: FusionDesign, samples: int) -> int:
    return max(round(samples * made.model.sample_time_s * 1000), 1)


def _value(s: SignalTable, wraps: bool = False) -> Entry:
    entry = _entry(s, s.name)
    about = f"Goes round: this, or any multiple of {(s.maximum - s.minimum + 1) * s.resolution:g} {unit_of(s.name)} more or less" if wraps else entry.about
    return Entry(**{**entry.__dict__, "unit": unit_of(s.name), "about": about})


def _sensor(made: FusionDesign, s: SourceTable) -> Message:
    stamp = "Sample index modulo 16 that the frame belongs to"
    about = f"Sent when the common prediction does not say it, at least every {made.tables.heartbeat_sensor} samples; silence is information."
    entries = (*_header(s.message.protection, stamp), _value(s.signal, s.wraps))
    return Message(s.message, _symbol(s.name), _symbol(f"{s.name}_sender"), (DETECTOR,), entries, "Event", _cycle_ms(made, made.tables.heartbeat_sensor), about)


def _verdict(made: FusionDesign, senders: tuple[str, ...]) -> Message:
    t = made.tables
    entries = [
        Entry("plant", 16, 2, high=3, values=PLANT, about="State of the sensors"),
        Entry("basis", 18, 2, high=3, values=BASIS, about="What the verdict rests on: bounds or probabilities"),
        Entry("reply", 20, 1, high=1, values=FLAG, about="Sent only to answer a tick in lockstep"),
        Entry("refused", 21, 1, high=1, values=FLAG, about="A number has been refused since the start"),
    ]
    entries += [Entry(_numbered("fault", n, i), 24 + i, 1, high=1, values=FAULT, about=f"Is sensor {n} dead, frozen or biased?") for i, n in enumerate(made.model.names)]
    shared = ["" if i + BUS_SENSORS >= t.sensors else f" and {made.model.names[i + BUS_SENSORS]}" for i in range(t.sensors)]
    for i, n in enumerate(made.model.names[:BUS_SENSORS]):
        entries.append(Entry(_numbered("bus", n, i), 40 + 2 * i, 2, high=3, values=BUS, about=f"Health of the link from sensor {n}{shared[i]}"))
    about = "Bits 11 .. 4 of the sample index; with the stamp, the index modulo 4096"
    entries.append(Entry("sample_high", 56, 8, factor=16, high=16 * 255, about=about))
    header = _header(t.verdict.protection, "Low 4 bits of the sample index that the verdict speaks of")
    return Message(t.verdict, "verdict", DETECTOR, senders, (*header, *entries), "Event", _cycle_ms(made, t.heartbeat), "Sent when the verdict changes, and as a heartbeat.")


def messages_of(made: FusionDesign) -> tuple[Message, ...]:
    """All frames of a model."""
    t = made.tables
    senders = tuple(_symbol(f"{s.name}_sender") for s in t.source)
    tick = _header(t.tick.protection, "Sample index modulo 16 that it closes")
    status = (
        *_header(t.status.protection, "Low 4 bits of the sample index"),
        Entry("model_hash", 16, 32, high=2**32 - 1, about=f"Of the node's tables; of this file: {t.hash}"),
        Entry("frames_lost", 48, 8, high=255, about="Frames lost by the sequence counters since the start, saturated"),
        Entry("frames_refused", 56, 8, high=255, about="Frames damaged, malformed, early, late or out of range since the start, saturated"),
    )
    about = "Sent with every sample, after all others of the sample, by any one node: it closes the sample."
    found = [_sensor(made, s) for s in t.source]
    found += [Message(t.tick, "tick", "clock", (DETECTOR, *senders), tick, "Cyclic", _cycle_ms(made, 1), about), _verdict(made, senders)]
    found.append(Message(t.status, "status", DETECTOR, senders, status, "Cyclic", _cycle_ms(made, t.heartbeat), "Sent with every heartbeat of the verdict."))
    for e in t.estimate:
        entries = (*_header(e.message.protection, "Low 4 bits of the sample index"), *(_value(s) for s in e.signals))
        about = "Estimate of a state and its standard deviation."
        found.append(Message(e.message, _symbol(e.message.name), DETECTOR, senders, entries, "Cyclic", _cycle_ms(made, t.interval), about))
    return tuple(found)


def emit_dbc(made: FusionDesign) -> str:
    """Text of NAME.dbc."""
    return dbc_text(made, messages_of(made))


def write_all(made: FusionDesign, out_dir: Path) -> tuple[Path, ...]:
    """Write NAME.h, NAME.c, NAME_config.h and NAME.dbc; files that already hold the same bytes are left alone. Returns those that changed."""
    header, source = emit_c(made)
    out_dir.mkdir(parents=True, exist_ok=True)
    changed = []
    for suffix, text in ((".h", header), (".c", source), ("_config.h", emit_config(made)), (".dbc", emit_dbc(made))):
        path, data = out_dir / (made.tables.name + suffix), text.encode("ascii")
        if not path.is_file() or path.read_bytes() != data:
            path.write_bytes(data)
            changed.append(path)
    return tuple(changed)
