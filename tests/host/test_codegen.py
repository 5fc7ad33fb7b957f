"""Generated C and DBC: the same bytes each time, no warning, the very numbers of the tables, and frames that cantools agrees with."""

from __future__ import annotations

import ctypes
import random
import re
import shutil
import subprocess
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from cantools.database.can import Database, Message
from host_support import REALS
from hullguard.codegen import emit_c, emit_config, emit_dbc, write_all
from hullguard.codegen.c import fill, real
from hullguard.codegen.dbc import short
from hullguard.codegen.names import LIBRARY
from hullguard.codegen.uio import emit_uio
from hullguard.design.bank_types import BankTable
from hullguard.core.library import library
from hullguard.core.native import Native
from hullguard.design.design import Design, design
from hullguard.design.fixed import lower
from hullguard.design.protection import MODES, PROFILES
from hullguard.design.statistic import FILTER_COUNTS, FILTER_NUMBERS, FILTER_WIDE, StatisticTable
from hullguard.design.tables import (
    EXTENDED,
    FD,
    FLOAT32,
    MOTOROLA,
    SIGNED,
    GeneratorTable,
    GroupTable,
    MessageTable,
    MismatchTable,
    ModalGeneratorTable,
    PredictTable,
    SignalTable,
    Tables,
)
from hullguard.design.zonotope_table import ZonotopeTable
from hullguard.errors import InputError
from hullguard.model.fusion import KIND, kind_of
from hullguard.model.schema import SHIPPED, load_model

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "firmware" / "models"
DETECTORS = sorted(p.stem for p in SHIPPED.glob("*.toml") if not p.stem.endswith(".design") and kind_of(str(p)) != KIND)
SOURCES = sorted((ROOT / "firmware" / "src").glob("*.c"))
WARNINGS = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wdouble-promotion", "-Wfloat-equal"]
WARNINGS += ["-Wstrict-prototypes", "-Wmissing-prototypes", "-Wshadow", "-Wcast-align", "-Wvla", "-Wundef", "-Wswitch-enum"]
WARNINGS += ["-ffp-contract=off", "-Werror"]
COMPILERS = [c for c in ("gcc", "clang-19") if shutil.which(c)]
SEED = 20
UNITS = {"m": "m", "mps": "m/s", "mps2": "m/s^2", "pct": "%", "n": "N"}

# A closing group without signals, a frame of CAN FD with float32 and offset signals and three levels, an extended identifier, two generators.
TANK = """
schema = 1
name = "tank"
kind = "linear"
sample_time_s = 0.02

[bus]
bitrate_bps = 500000

[plant]
A = [[0.9, 0.05, 0.0], [0.1, 0.8, 0.1], [0.0, 0.1, 0.85]]
B = [[0.1], [0.0], [0.02]]
C = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
discrete = true
initial_range = [0.5, 0.5, 0.5]
disturbance = { state = [0.01, 0.01, 0.01], output = [0.01, 0.01, 0.01] }

[[signals]]
name = "level1_m"
role = "output"
range = [-30.0, 30.0]
resolution = 0.01
wire = "float32"
slew = [1.0, 2.0, 3.0]

[[signals]]
name = "level2_m"
role = "output"
range = [-30.0, 30.0]
resolution = 0.003
wire = "float32"
slew = [1.0, 2.0, 3.0]

[[signals]]
name = "level3_m"
role = "output"
range = [5.0, 80.5]
resolution = 0.01
slew = [1.0, 2.0, 3.0]

[[signals]]
name = "valve_pct"
role = "input"
range = [-3.0, 3.0]
resolution = 0.1
slew = [1.0, 2.0]

[[groups]]
name = "levels_in_tank"
signals = ["level1_m", "level2_m", "level3_m"]
frame = { id = 0x210, fd = true }
trigger = { delta = [0.01, 0.05], sigma = [0.05, 0.05, 0.1], silence = [0, 2], levels = 3, interval_max = 6 }

[[groups]]
name = "valve"
signals = ["valve_pct"]
frame = { id = 0x220, extended = true }
transmission = "periodic"

[[groups]]
name = "tick"
frame = { id = 0x230 }
transmission = "tick"

[verdict]
frame = { id = 0x240 }
heartbeat_samples = 25
debounce = { up = 2, down = 3 }
latch = true

[detector]
observers = [
    { order = 3, residuals = 1, faults = ["valve_stuck"], search = { trials = 40, seed = 1 } },
    { order = 2, residuals = 1, outputs = ["level1_m", "level2_m"], faults = ["valve_stuck"], search = { trials = 40, seed = 2 } },
]

[[faults]]
name = "valve_stuck"
signal = "valve_pct"
type = "actuator"
"""

# Writes every number of a configuration, wherever it lies.
DUMP = r"""
#include "hullguard/node.h"
#include <inttypes.h>
#include <stdio.h>

void dump(FILE *into, const hg_node_config *config, const hg_sender_config *sender);

static FILE *out;

static void u(const char *tag, uint64_t x) { (void)fprintf(out, "%s %" PRIu64 "\n", tag, x); }
static void s(const char *tag, int32_t x) { (void)fprintf(out, "%s %" PRId32 "\n", tag, x); }
static void r(const char *tag, hg_real x) { (void)fprintf(out, "%s %a\n", tag, (double)x); }
static void us(const char *tag, const uint8_t *x, unsigned n) { for (unsigned i = 0U; i < n; i++) { u(tag, x[i]); } }
static void rs(const char *tag, const hg_real *x, unsigned n) { for (unsigned i = 0U; i < n; i++) { r(tag, x[i]); } }

static void matrix(const char *tag, const hg_matrix *m)
{
    u("rows", m->rows);
    u("cols", m->cols);
    s("exponent", m->exponent);
    rs(tag, m->data, (unsigned)m->rows * m->cols);
}

static void message(const hg_message *m)
{
    u("id", m->id);
    u("flags", m->flags);
    u("length", m->length);
    u("width", m->width);
    u("profile", (uint64_t)m->e2e->profile);
    u("mode", (uint64_t)m->e2e->mode);
    u("crc", m->e2e->crc);
    u("counter", m->e2e->counter);
    u("nibble", m->e2e->nibble);
    u("stamp", m->e2e->stamp);
    u("data_id", m->e2e->data_id);
    if (m->e2e->data_ids != NULL) { us("data_ids", m->e2e->data_ids, HG_E2E_IDS); }
    if (m->idle != NULL) { us("idle", m->idle, m->length); }
    for (unsigned i = 0U; i < m->width; i++) {
        u("start", m->field[i].start);
        u("bits", m->field[i].length);
        u("field_flags", m->field[i].flags);
        r("resolution", m->scale[i].resolution);
        r("offset", m->scale[i].offset);
        r("per_unit", m->scale[i].per_unit);
        s("scale_exponent", m->scale[i].exponent);
        s("minimum", m->scale[i].minimum);
        s("maximum", m->scale[i].maximum);
    }
}

static void group(const hg_hold_config *hold, const hg_message *frame, const hg_sender_config *sender)
{
    const hg_trigger_config *t = hold->trigger;
    const unsigned n = (unsigned)t->levels * t->width;
    message(frame);
    u("sender", (sender->message == frame) && (sender->trigger == t) && (hold->scale == frame->scale));
    u("levels", t->levels);
    u("interval_max", t->interval_max);
    u("margin", hold->margin);
    us("silence", t->silence, t->levels);
    for (unsigned i = 0U; i < n; i++) { u("delta", t->delta[i]); }
    for (unsigned i = 0U; i < n; i++) { s("sigma", t->sigma[i]); }
    for (unsigned i = 0U; i < n; i++) { s("activity", t->activity[i]); }
    for (unsigned i = 0U; i < t->width; i++) { s("zero", t->zero[i]); }
    rs("half", hold->half, t->width);
    rs("slew", hold->slew, ((unsigned)t->interval_max + hold->margin) * t->width);
    rs("span", hold->span, t->width);
    rs("middle", hold->middle, t->width);
}

static void hull(const hg_hull_config *h)
{
    u("wide", h->width);
    us("wide", h->signal, h->width);
    s("hull_exponent", h->exponent);
    us("taps", h->taps, h->width);
    unsigned taps = 0U;
    for (unsigned g = 0U; g < h->width; g++) { taps += h->taps[g] + 1U; }
    rs("weight", h->weight, taps * h->residuals);
    u("settle", h->settle);
    rs("rest", h->rest, (unsigned)h->settle * h->residuals);
    rs("rest_left", h->rest_left, h->residuals);
    rs("moving", h->moving, (unsigned)h->settle * h->residuals);
    rs("moving_left", h->moving_left, h->residuals);
    rs("hull_bias", h->bias, h->residuals);
    u("ready_rest", h->ready_rest);
    u("ready_moving", h->ready_moving);
    rs("decay", h->decay, h->residuals);
    u("modes", h->modes);
    if (h->modes > 0U) {
        rs("mode_decay", h->mode_decay, h->modes);
        rs("mode_input", h->mode_input, (unsigned)h->modes * h->width);
        rs("mode_output", h->mode_output, (unsigned)h->residuals * h->modes);
        rs("mode_rest", h->mode_rest, h->modes);
        rs("mode_moving", h->mode_moving, h->modes);
    }
}

static void zonotope(const hg_zonotope_config *z)
{
    unsigned of_state = 0U;
    for (unsigned i = 0U; i < z->blocks; i++) { of_state += (unsigned)z->block[i] * z->block[i]; }
    u("wide", z->width);
    us("wide", z->signal, z->width);
    u("order", z->order);
    u("columns", z->columns);
    u("reduction", (uint64_t)z->reduction);
    u("blocks", z->blocks);
    us("block", z->block, z->blocks);
    rs("state", z->state, of_state);
    rs("input", z->input, (unsigned)z->width * z->order);
    u("disturbances", z->disturbances);
    rs("disturbance", z->disturbance, (unsigned)z->disturbances * z->order);
    u("initial", z->initial);
    rs("rest", z->rest, (unsigned)z->initial * z->order);
    rs("moving", z->moving, (unsigned)z->initial * z->order);
    rs("output", z->output, (unsigned)z->residuals * z->order);
    rs("outer", z->outer, (unsigned)z->residuals * z->order);
    rs("direct", z->direct, (unsigned)z->residuals * z->width);
    u("settle", z->settle);
    rs("bias_rest", z->bias_rest, (unsigned)z->settle * z->residuals);
    rs("bias_moving", z->bias_moving, (unsigned)z->settle * z->residuals);
    rs("decay", z->decay, z->blocks);
    rs("always", z->always, z->order);
    rs("growth", z->growth, z->order);
    rs("output_growth", z->output_growth, z->residuals);
    u("recover", z->recover);
    u("ready_rest", z->ready_rest);
    u("ready_moving", z->ready_moving);
}

static void predictor(const hg_predict_config *p)
{
    u("group", p->group);
    u("first", p->first);
    u("order", p->order);
    u("width", p->width);
    u("inputs", p->inputs);
    us("input", p->input, p->inputs);
    rs("known", p->known, p->inputs);
    matrix("correct", &p->correct);
    matrix("state", &p->state);
    matrix("drive", &p->drive);
    matrix("output", &p->output);
    matrix("direct", &p->direct);
    rs("fresh", p->fresh, p->width);
    u("horizon", p->horizon);
    rs("radius", p->radius, (unsigned)p->horizon * p->width);
    u("settle", p->settle);
}

static void uncertain(const hg_mismatch_config *m)
{
    u("states", m->states);
    u("width", m->width);
    s("mismatch_exponent", m->exponent);
    us("signal", m->signal, m->width);
    rs("constant", m->constant, m->states);
    rs("gain", m->gain, (unsigned)m->states * m->width);
}

static void certificates(const hg_bank_config *b)
{
    const unsigned n = (unsigned)b->window * b->certificates;
    u("certificates", b->certificates);
    u("window", b->window);
    u("width", b->width);
    us("signal", b->signal, b->width);
    s("bank_exponent", b->exponent);
    rs("weight", b->weight, n * b->width);
    rs("bias", b->bias, b->certificates);
    r("widen", b->widen);
    u("extras", b->extras);
    us("extra", b->extra, b->extras);
    rs("extra_weight", b->extra_weight, n * b->extras);
}

static void generator(const hg_residual_config *g, const hg_hull_config *h, const hg_zonotope_config *z)
{
    u("order", g->order);
    u("residuals", g->residuals);
    u("width", g->width);
    us("signal", g->signal, g->width);
    matrix("state", &g->state);
    matrix("input", &g->input);
    matrix("output", &g->output);
    matrix("direct", &g->direct);
    u("threshold", (h != NULL) ? h->residuals : z->residuals);
    if (h != NULL) {
        hull(h);
    } else {
        zonotope(z);
    }
}

static void map(const hg_polynomial_map *m, unsigned rows)
{
    const unsigned terms = m->end[rows - 1U];
    u("map_width", m->width);
    for (unsigned i = 0U; i < rows; i++) { u("end", m->end[i]); }
    rs("coefficient", m->coefficient, terms);
    us("factor", m->factor, terms * m->width);
}

static void filter(const hg_statistic_config *c)
{
    const hg_polynomial_config *f = &c->filter;
    const unsigned rows = (unsigned)f->lifted + f->measured;
    const unsigned wide = (unsigned)f->lifted + 1U;
    u("states", f->states);
    u("outputs", f->outputs);
    u("degree", f->degree);
    u("bounded", f->bounded);
    u("lifted", f->lifted);
    u("measured", f->measured);
    u("judged", f->judged);
    u("noises", f->noises);
    u("ring", f->ring);
    u("lower", f->lower);
    map(&f->f, f->states);
    map(&f->h, f->outputs);
    for (unsigned i = 0U; i <= f->ring; i++) { u("start", f->start[i]); }
    for (unsigned i = 0U; i < f->start[f->ring]; i++) { u("product", f->product[i]); }
    us("parent", f->parent, rows);
    us("factor", f->factor, rows);
    us("noise", f->noise, f->lower);
    us("moment", f->moment, f->lower);
    rs("mean", f->mean, f->noises);
    rs("covariance", f->covariance, (unsigned)f->noises * f->noises);
    if (f->bounded) {
        us("cut_moment", f->cut_moment, (unsigned)f->ring - f->lower);
        us("cut_state", f->cut_state, (unsigned)f->ring - f->lower);
        rs("cut_scale", f->cut_scale, (unsigned)f->ring - f->lower);
    }
    rs("box", f->box, f->states);
    rs("x0", f->x0, f->states);
    rs("P0", f->P0, (unsigned)f->states * f->states);
    rs("M0", f->M0, wide * wide);
    rs("Q", f->Q, f->states);
    rs("R", f->R, f->outputs);
    rs("range", f->range, f->outputs);
    rs("fresh", f->fresh, f->outputs);
    r("reach", f->reach);
    r("kappa", f->kappa);
    r("joint", f->joint);
    r("weight", f->weight);
    r("drift", f->drift);
    us("signal", c->signal, f->outputs);
    rs("gain", c->gain, f->outputs);
    u("inputs", c->inputs);
    us("input", c->input, c->inputs);
    rs("zero", c->zero, c->inputs);
    rs("drive", c->drive, (unsigned)f->states * c->inputs);
    rs("direct", c->direct, (unsigned)f->outputs * c->inputs);
    rs("known", c->known, c->inputs);
    u("settle", c->settle);
}

void dump(FILE *into, const hg_node_config *config, const hg_sender_config *sender)
{
    const hg_detector_config *d = config->detector;
    out = into;
    u("signals", d->signals);
    u("all_signals", d->width);
    u("groups", d->groups);
    for (unsigned i = 0U; i < d->groups; i++) { group(&d->hold[i], &config->message[i], &sender[i]); }
    u("generators", d->generators);
    u("either", (d->generators == 0U) || ((d->hull == NULL) != (d->zonotope == NULL)));
    for (unsigned i = 0U; i < d->generators; i++) {
        generator(&d->residual[i], (d->hull != NULL) ? &d->hull[i] : NULL, (d->zonotope != NULL) ? &d->zonotope[i] : NULL);
    }
    u("predictors", d->predictors);
    for (unsigned i = 0U; i < d->predictors; i++) { predictor(&d->predict[i]); }
    u("uncertain", d->mismatch != NULL);
    if (d->mismatch != NULL) { uncertain(d->mismatch); }
    u("banks", d->banks);
    for (unsigned i = 0U; i < d->banks; i++) { certificates(&d->bank[i]); }
    u("polynomials", d->polynomials);
    for (unsigned i = 0U; i < d->polynomials; i++) { filter(&d->polynomial[i]); }
    u("decisions", d->decision.generators);
    us("feeds", d->decision.feeds, d->decision.generators);
    for (unsigned i = 0U; i < d->decision.generators; i++) { u("faults", d->decision.faults[i]); }
    u("up", d->decision.up);
    u("down", d->decision.down);
    u("latch", d->decision.latch);
    u("history", d->history);
    u("values", d->window);
    u("all_residuals", d->residuals);
    u("codes", d->codes);
    u("reals", d->reals);
    u("sums", d->sums);
    u("closing", config->closing);
    message(config->verdict);
    message(config->status);
    u("heartbeat", config->heartbeat);
    u("hash", config->model_hash);
}
"""

# The same into a file, for structures that another program has filled.
FILED = r"""
int filed(const char *path, const hg_node_config *config, const hg_sender_config *sender);

int filed(const char *path, const hg_node_config *config, const hg_sender_config *sender)
{
    FILE *const file = fopen(path, "w");
    if (file == NULL) { return 1; }
    dump(file, config, sender);
    return fclose(file);
}
"""

# Prints every number of the generated configuration, or packs and unpacks frames: lines of "group counter stamp code ..".
PROBE = r"""
#include MODEL_HEADER
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void dump(FILE *into, const hg_node_config *config, const hg_sender_config *sender);

static NODE node;
static SENDERS senders;

static void u(const char *tag, uint64_t x) { (void)printf("%s %" PRIu64 "\n", tag, x); }

static void storage(void)
{
    u("needed", hg_detector_reals(CONFIG.detector));
    u("stored", sizeof node.real / sizeof node.real[0]);
    u("needed", hg_detector_sums(CONFIG.detector));
    u("stored", SUMS);
    u("node", START_NODE(&node, HG_START_MOVING) == HG_OK);
    u("null", START_NODE(NULL, HG_START_MOVING) == HG_E_ARGUMENT);
    u("senders", START_SENDERS(&senders) == HG_OK);
    u("null", START_SENDERS(NULL) == HG_E_ARGUMENT);
}

static void exchange(const hg_message *m, long counter, long stamp)
{
    int32_t code[HG_GROUP_SIGNALS_MAX];
    int32_t back[HG_GROUP_SIGNALS_MAX];
    hg_can_frame frame;
    for (unsigned i = 0U; i < m->width; i++) {
        if (scanf("%" SCNd32, &code[i]) != 1) { exit(3); }
    }
    hg_frame_pack(m, code, &frame);
    if (hg_e2e_protect(m->e2e, frame.data, frame.length, (uint8_t)counter, (uint8_t)stamp) != HG_OK) { exit(4); }
    if (hg_frame_unpack(m, &frame, back) != HG_OK) { exit(5); }
    for (unsigned i = 0U; i < frame.length; i++) { (void)printf("%02x", frame.data[i]); }
    for (unsigned i = 0U; i < m->width; i++) { (void)printf(" %" PRId32, back[i]); }
    for (unsigned i = 0U; i < m->width; i++) { (void)printf(" %a", (double)hg_code_value(&m->scale[i], back[i])); }
    (void)printf("\n");
}

int main(int argc, char **argv)
{
    unsigned index;
    long counter;
    long stamp;
    if ((argc > 1) && (strcmp(argv[1], "dump") == 0)) {
        dump(stdout, &CONFIG, SENDER);
        storage();
        return 0;
    }
    while (scanf("%u %ld %ld", &index, &counter, &stamp) == 3) { exchange(&CONFIG.message[index], counter, stamp); }
    return 0;
}
"""

# Plays what a node hands out, in hexadecimal: the first report (verdict and status), then a reply.
REPORT = r"""
#include MODEL_HEADER
#include <stdio.h>

static NODE node;

int main(void)
{
    const hg_verdict verdict = {.k = 0xABCU, .model_hash = CONFIG.model_hash, .candidates = 1U, .plant = HG_PLANT_CONFIRMED,
                                .basis = HG_BASIS_SET, .bus = 0x1BU, .refused = true};
    hg_can_frame frame[2];
    if (START_NODE(&node, HG_START_REST) != HG_OK) { return 1; }
    for (unsigned round = 0U; round < 2U; round++) {
        const uint8_t count = hg_node_report(&node.node, &verdict, true, frame);
        for (unsigned i = 0U; i < count; i++) {
            for (unsigned b = 0U; b < frame[i].length; b++) { (void)printf("%02x", frame[i].data[b]); }
            (void)printf(" %lu\n", (unsigned long)frame[i].id);
        }
    }
    return 0;
}
"""


def changed_places(d: Design) -> Design:
    """A design whose first group has big-endian, unsigned and odd fields, as an existing network may."""
    first, *rest = d.tables.groups
    a, b, c = first.signals
    signals = (
        replace(a, start=23, length=17, flags=MOTOROLA | SIGNED),
        replace(b, start=38, length=15, flags=MOTOROLA, offset=-16.0, minimum=0, maximum=32000, zero=16000),
        replace(c, start=48, length=16, flags=0, offset=-20.0, minimum=0, maximum=40000, zero=20000),
    )
    tables = replace(d.tables, groups=(replace(first, signals=signals), *rest), fixed=None)
    linear, given, hulls = (tuple(getattr(g, part) for g in d.generators) for part in ("linear", "given", "tables"))
    return replace(d, tables=replace(tables, fixed=lower(tables, linear, given, hulls, "places").tables))


# All that a design may have beside observers and hulls; banks of the shipped one, whatever else is asked for.
DRAG = {"plant.drag_per_s": {"value": 1.0, "pm": 0.1}}
UNCERTAIN = DRAG | {"detector.prediction": True}
EVERYTHING = UNCERTAIN | {"detector.threshold": "zonotope"}


@pytest.fixture(scope="module")
def designs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Design]:
    """Shipped models, the small one, one with fields of another kind, and those with every other part."""
    path = tmp_path_factory.mktemp("models") / "tank.toml"
    path.write_text(TANK, encoding="utf-8")
    platoon = design(load_model("platoon"))[0]
    made = {"platoon": platoon, "tank": design(load_model(str(path)))[0], "places": changed_places(platoon), "bank": design(load_model("platoon_bank"))[0]}
    made["uncertain"] = design(load_model("platoon", UNCERTAIN))[0]
    made["drag"] = design(load_model("platoon_bank", DRAG))[0]
    made["suspension"] = design(load_model("suspension"))[0]
    made["cubic"] = design(load_model("cubic_suspension", {"detector.polynomial": [{"degree": 2}, {"degree": 1, "bounded": True}]}))[0]
    made["everything"] = design(load_model("platoon_bank", EVERYTHING))[0]
    made["network"] = design(load_model(str(ROOT / "tests" / "fixtures" / "network" / "network.toml")))[0]
    made["published"] = design(load_model("platoon", {"detector.threshold": "zonotope_published"}))[0]
    return made


NAMES = ("platoon", "tank", "places", "bank", "drag", "uncertain", "everything", "published", "network", "suspension", "cubic")
FIXED = ("platoon", "places", "bank", "drag", "suspension")  # those that fixed point can hold
NUMBERS = [(name, real) for name in NAMES for real in REALS if real != "q31" or name in FIXED]
FIELDS = {"crc": "E2E_CRC", "counter": "E2E_counter", "nibble": "E2E_data_id", "stamp": "E2E_stamp"}


@dataclass(frozen=True)
class Built:
    """A model's files and programs."""

    design: Design
    dir: Path
    database: Database

    def run(self, program: str, *arguments: str, given: str = "") -> list[str]:
        """Lines that a program prints."""
        done = subprocess.run([self.dir / program, *arguments], input=given, capture_output=True, text=True, check=True, timeout=60)
        return done.stdout.splitlines()


def definitions(tables: Tables) -> list[str]:
    """How a probe is told the model's names, and the length of an array that only a model with banks has."""
    name = tables.name
    parts = {"MODEL_HEADER": f'"{name}.h"', "CONFIG": f"hg_{name}_config", "SENDER": f"hg_{name}_sender"}
    parts |= {"NODE": f"hg_{name}_node", "SENDERS": f"hg_{name}_senders"}
    parts |= {"START_NODE": f"hg_{name}_node_start", "START_SENDERS": f"hg_{name}_senders_start"}
    parts["SUMS"] = "(sizeof node.sum / sizeof node.sum[0])" if tables.banks else "0U"
    return [f"-D{key}={value}" for key, value in parts.items()]


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Path]]:
    """The library, for each number type."""
    made: dict[str, list[Path]] = {}
    for r in REALS:
        out = tmp_path_factory.mktemp(f"library_{r}")
        command = ["gcc", *WARNINGS, "-O1", "-fsanitize=undefined", "-fno-sanitize-recover=all", f"-DHG_REAL_{r.upper()}=1", f"-I{ROOT}/firmware/include", "-c"]
        subprocess.run([*command, *map(str, SOURCES)], cwd=out, check=True)
        made[r] = sorted(out.glob("*.o"))
    return made


@pytest.fixture(scope="module", params=NAMES)
def built(request: pytest.FixtureRequest, designs: dict[str, Design], objects: dict[str, list[Path]], tmp_path_factory: pytest.TempPathFactory) -> Built:
    """A model's generated files, compiled and linked with the library under every warning."""
    d, name = designs[request.param], designs[request.param].tables.name
    out = tmp_path_factory.mktemp(request.param)
    write_all(d, out)
    (out / "dump.c").write_text(DUMP, encoding="ascii")
    for program, text in (("probe", PROBE), ("report", REPORT)):
        (out / f"{program}.c").write_text(text, encoding="ascii")
        for r in REALS if program == "probe" else ("f32",):
            if (request.param, r) not in NUMBERS:
                continue
            more = [str(out / "dump.c")] if program == "probe" else []
            command = ["gcc", *WARNINGS, "-O1", "-fsanitize=undefined", "-fno-sanitize-recover=all", f"-DHG_REAL_{r.upper()}=1", *definitions(d.tables)]
            command += [f"-I{ROOT}/firmware/include", f"-I{out}", str(out / f"{program}.c"), *more, str(out / f"{name}.c"), *map(str, objects[r])]
            subprocess.run([*command, "-o", str(out / f"{program}_{r}")], check=True)
    database = cantools.database.load_string((out / f"{name}.dbc").read_text(encoding="ascii"), "dbc", strict=True)
    assert isinstance(database, Database)
    return Built(d, out, database)


# --- text ------------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_the_same_design_gives_the_same_bytes(designs: dict[str, Design], name: str) -> None:
    again = design(load_model("platoon"))[0] if name == "platoon" else designs[name]
    assert emit_c(designs[name]) == emit_c(again)
    assert emit_dbc(designs[name]) == emit_dbc(again)


@pytest.mark.parametrize("name", NAMES)
def test_text_is_plain_and_says_where_it_comes_from(designs: dict[str, Design], name: str) -> None:
    d = designs[name]
    for text in (*emit_c(d), emit_dbc(d)):
        assert text.isascii() and text.endswith("\n")
        assert d.model.sha256 in text and f"0x{d.tables.hash:08X}" in text and f"{d.tables.name}.design.toml" in text
        assert "do not edit" in text
        assert str(ROOT) not in text and "/" + "tmp" not in text and not re.search(r"20\d\d-\d\d", text)
    for text in emit_c(d):
        assert max(map(len, text.splitlines())) <= 140
        assert not re.search(r"[ \t]$", text, re.MULTILINE)


@pytest.mark.parametrize("name", DETECTORS)
def test_shipped_files_are_those_of_the_shipped_models(name: str) -> None:
    made = design(load_model(name))[0]
    header, source = emit_c(made)
    assert (MODELS / f"{name}.h").read_text(encoding="ascii") == header
    assert (MODELS / f"{name}.c").read_text(encoding="ascii") == source
    assert (MODELS / f"{name}.dbc").read_text(encoding="ascii") == emit_dbc(made)
    assert (MODELS / f"{name}_config.h").read_text(encoding="ascii") == emit_config(made)
    for suffix, text in zip((".h", ".c"), emit_uio(made) if made.uios else (), strict=False):
        assert (MODELS / f"{name}_uio{suffix}").read_text(encoding="ascii") == text
        assert max(map(len, text.splitlines())) <= 140 and not re.search(r"[ \t]$", text, re.MULTILINE) and made.model.sha256 in text


def test_a_model_called_like_a_header_of_the_library_is_refused(designs: dict[str, Design]) -> None:
    assert {p.stem for p in (ROOT / "firmware" / "include" / "hullguard").glob("*.h")} == LIBRARY
    d = designs["tank"]
    with pytest.raises(InputError, match=r"zonotope\.h.*rename"):
        emit_c(replace(d, tables=replace(d.tables, name="zonotope")))


def test_files_are_written_only_when_they_change(designs: dict[str, Design], tmp_path: Path) -> None:
    d = designs["tank"]
    assert [p.name for p in write_all(d, tmp_path)] == ["tank.h", "tank.c", "tank_config.h", "tank.dbc"]
    before = {p.name: p.stat().st_mtime_ns for p in tmp_path.iterdir()}
    assert write_all(d, tmp_path) == ()
    assert {p.name: p.stat().st_mtime_ns for p in tmp_path.iterdir()} == before
    (tmp_path / "tank.c").write_text("spoiled", encoding="ascii")
    assert [p.name for p in write_all(d, tmp_path)] == ["tank.c"]


def test_literals_are_exact() -> None:
    for x in (0.0, -0.0, 1.0, -1.5, float(np.float32(0.1)), float(np.float32(1e-45)), float(np.finfo(np.float32).max)):
        literal = real(x)
        inner = literal.removeprefix("HG_REAL_C(").removesuffix(")")
        assert float.fromhex(inner).hex() == x.hex()
    for x in (0.1, float("inf"), float("nan"), 1e300):
        with pytest.raises(ValueError, match="not a float32 number"):
            real(x)


def test_long_rows_are_spread_evenly() -> None:
    lines = fill([f"HG_REAL_C(0x1.{i:06x}p-10)" for i in range(13)])
    assert max(map(len, lines)) <= 140
    assert {line.count("HG_REAL_C") for line in lines[:-1]} == {lines[0].count("HG_REAL_C")}
    assert sum(line.count("HG_REAL_C") for line in lines) == 13


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", sorted(set(NAMES) - set(FIXED)))
def test_a_model_without_a_fixed_point_form_says_so_to_the_compiler(designs: dict[str, Design], tmp_path: Path, name: str, compiler: str) -> None:
    d = designs[name]
    write_all(d, tmp_path)
    command = [compiler, "-std=c11", "-DHG_REAL_Q31=1", f"-I{ROOT}/firmware/include", "-fsyntax-only", str(tmp_path / f"{d.tables.name}.c")]
    failed = subprocess.run(command, capture_output=True, text=True, check=False)
    said = " ".join(failed.stderr.split())
    assert failed.returncode != 0
    assert d.tables.not_fixed and d.tables.not_fixed.replace('"', "'") in said


@pytest.mark.parametrize(("group", "message"), [("Status", "the detector's own frame"), ("Measure-ment", "'Measure-ment' have the same identifier")])
def test_names_that_would_collide_are_refused(designs: dict[str, Design], group: str, message: str) -> None:
    d = designs["platoon"]
    first, second = d.tables.groups
    both = (replace(first, name="measure ment"), replace(second, name=group))
    for emit in (emit_c, emit_dbc):
        with pytest.raises(InputError, match=message):
            emit(replace(d, tables=replace(d.tables, groups=both)))


@pytest.mark.parametrize("name", ["group_control", "units"])
def test_a_signal_named_like_a_constant_is_refused(designs: dict[str, Design], name: str) -> None:
    d = designs["platoon"]
    first, second = d.tables.groups
    signals = (replace(first.signals[0], name=name), *first.signals[1:])
    with pytest.raises(InputError, match=f"HG_PLATOON_{name.upper()}"):
        emit_c(replace(d, tables=replace(d.tables, groups=(replace(first, signals=signals), second))))


# --- C ---------------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize(("name", "number"), NUMBERS)
def test_compiles_without_a_warning(designs: dict[str, Design], tmp_path: Path, name: str, number: str, compiler: str) -> None:
    d = designs[name]
    write_all(d, tmp_path)
    model = d.tables.name
    command = [compiler, *WARNINGS, f"-DHG_REAL_{number.upper()}=1", f"-I{ROOT}/firmware/include"]
    subprocess.run([*command, "-c", str(tmp_path / f"{model}.c"), "-o", str(tmp_path / "out.o")], check=True)


def test_header_is_cpp_too(designs: dict[str, Design], tmp_path: Path) -> None:
    write_all(designs["tank"], tmp_path)
    (tmp_path / "use.cpp").write_text('#include "tank.h"\n#include "tank.h"\nhg_tank_node node;\nhg_tank_senders senders;\n', encoding="ascii")
    subprocess.run(["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", f"-I{ROOT}/firmware/include", "-fsyntax-only", str(tmp_path / "use.cpp")], check=True)


@pytest.mark.parametrize(("limit", "least"), [("HG_GROUPS_MAX", 3), ("HG_GROUP_SIGNALS_MAX", 3), ("HG_LEVELS_MAX", 3), ("HG_GENERATORS_MAX", 2)])
def test_too_small_a_limit_is_an_error_that_names_it(designs: dict[str, Design], tmp_path: Path, limit: str, least: int) -> None:
    write_all(designs["tank"], tmp_path)
    command = ["gcc", "-std=c11", f"-I{ROOT}/firmware/include", "-fsyntax-only", str(tmp_path / "tank.c")]
    subprocess.run([*command, f"-D{limit}={least}U"], check=True)
    failed = subprocess.run([*command, f"-D{limit}={least - 1}U"], capture_output=True, text=True, check=False)
    assert failed.returncode != 0
    assert f"model tank needs {limit} of at least {least}" in failed.stderr


@pytest.mark.parametrize("name", DETECTORS)
def test_a_config_is_what_its_model_needs_and_no_more(name: str, tmp_path: Path) -> None:
    """The model compiles with its config; with any option of it less, or a part less, it does not, and says which. The digest no model needs: it is the user's to leave out."""
    text = (MODELS / f"{name}_config.h").read_text(encoding="ascii")
    options = re.findall(r"^#define (HG_\w+) (\d+)U?$", text, re.MULTILINE)
    header = (ROOT / "firmware/include/hullguard/config.h").read_text(encoding="ascii")
    assert {macro for macro, _ in options} == set(re.findall(r"^#define (HG_(?:(?:WITH_(?!DIGEST\b)|ONLY_)\w+|(?!FUSION|POLYNOMIAL)\w+_MAX)) ", header, re.MULTILINE))
    command = ["gcc", *WARNINGS, f"-I{ROOT}/firmware/include", f"-I{tmp_path}", f"-I{MODELS}", "-DHG_CONFIG_HEADER=\"used.h\"", "-fsyntax-only", str(MODELS / f"{name}.c")]
    used = tmp_path / "used.h"
    used.write_text(text, encoding="ascii")
    subprocess.run(command, check=True)
    for macro, value in options:
        if int(value) > (0 if macro.startswith("HG_WITH_") else 1):
            used.write_text(re.sub(rf"{macro} {value}", f"{macro} {int(value) - 1}", text), encoding="ascii")
            failed = subprocess.run(command, capture_output=True, text=True, check=False)
            assert failed.returncode != 0 and f"model {name} needs {macro}" in failed.stderr


Numbers = list[tuple[str, float]]


def _each(tag: str, values: object) -> Numbers:
    """A number, or all numbers of nested tuples in order."""
    if isinstance(values, tuple):
        return [pair for v in values for pair in _each(tag, v)]
    assert isinstance(values, (int, float))
    return [(tag, float(values))]


def _message(m: MessageTable, signals: tuple[SignalTable, ...]) -> Numbers:
    numbers = [p for key in ("id", "flags", "length") for p in _each(key, getattr(m, key))]
    p = m.protection
    numbers += _each("width", len(signals)) + _each("profile", 1 + PROFILES.index(p.profile)) + _each("mode", 1 + MODES.index(p.mode))
    numbers += _some(p, "crc", "counter", "nibble", "stamp", "data_id", "data_ids") + _each("idle", m.idle)
    for s in signals:
        numbers += _each("start", s.start) + _each("bits", s.length) + _each("field_flags", s.flags)
        numbers += [p for key in ("resolution", "offset", "per_unit") for p in _each(key, getattr(s, key))]
        numbers += _each("scale_exponent", s.exponent) + _some(s, "minimum", "maximum")
    return numbers


def _group(g: GroupTable) -> Numbers:
    numbers = _message(g.message, g.signals) + _each("sender", 1)
    numbers += [p for key in ("levels", "interval_max", "margin", "silence", "delta", "sigma", "activity") for p in _each(key, getattr(g, key))]
    numbers += _each("zero", tuple(s.zero for s in g.signals)) + _each("half", tuple(s.half for s in g.signals)) + _each("slew", g.slew)
    return numbers + _each("span", tuple(s.span for s in g.signals)) + _each("middle", tuple(s.middle for s in g.signals))


def _some(values: object, *keys: str) -> Numbers:
    """Fields of a table, each under its own name."""
    return [p for key in keys for p in _each(key, getattr(values, key))]


def _matrix(tag: str, m: tuple[tuple[float, ...], ...], exponent: int = 0) -> Numbers:
    return _each("rows", len(m)) + _each("cols", len(m[0])) + _each("exponent", exponent) + _each(tag, m)


def _generator(g: GeneratorTable) -> Numbers:
    numbers = _each("order", len(g.state)) + _each("residuals", len(g.output)) + _each("width", len(g.signal)) + _each("signal", g.signal)
    moved, shown, summed = g.exponents
    for key, exponent in (("state", moved), ("input", moved), ("output", shown), ("direct", shown)):
        numbers += _matrix(key, getattr(g, key), exponent)
    numbers += _each("threshold", len(g.output))
    if g.zonotope is not None:
        return numbers + _zonotope(g.zonotope)
    numbers += _each("wide", len(g.wide)) + _each("wide", g.wide)
    numbers += _each("hull_exponent", summed) + _some(g, "taps") + _each("weight", _laid_out(g)) + _some(g, "settle", "rest", "rest_left", "moving", "moving_left")
    numbers += _each("hull_bias", g.bias) + _some(g, "ready_rest", "ready_moving", "decay")
    if not isinstance(g, ModalGeneratorTable):
        return numbers + _each("modes", 0)
    return numbers + _each("modes", len(g.mode_decay)) + _some(g, "mode_decay", "mode_input", "mode_output", "mode_rest", "mode_moving")


def _laid_out(g: GeneratorTable) -> tuple[float, ...]:
    """hull.h: residuals 0 and 1, then 2 and 3, .., of each two signal after signal, lag after lag, then the tail."""
    out: list[float] = []
    for first in range(0, len(g.output), 2):
        pair = range(first, min(first + 2, len(g.output)))
        for s, taps in enumerate(g.taps):
            out += [g.weight[lag][i][s] for lag in range(taps) for i in pair] + [g.tail[i][s] for i in pair]
    return tuple(out)


def _zonotope(z: ZonotopeTable) -> Numbers:
    numbers = _each("wide", len(z.signal)) + _each("wide", z.signal) + _some(z, "order", "columns", "reduction")
    numbers += _each("blocks", len(z.block)) + _some(z, "block", "state", "input")
    numbers += _each("disturbances", len(z.disturbance)) + _some(z, "disturbance") + _each("initial", len(z.rest))
    numbers += _some(z, "rest", "moving", "output", "outer", "direct", "settle", "bias_rest", "bias_moving")
    return numbers + _some(z, "decay", "always", "growth", "output_growth", "recover", "ready_rest", "ready_moving")


def _predictor(p: PredictTable) -> Numbers:
    numbers = _some(p, "group", "first") + _each("order", len(p.state)) + _each("width", len(p.output)) + _each("inputs", len(p.input)) + _some(p, "input", "known")
    for key in ("correct", "state", "drive", "output", "direct"):
        numbers += _matrix(key, getattr(p, key))
    return numbers + _some(p, "fresh") + _each("horizon", len(p.radius)) + _some(p, "radius", "settle")


def _bank(b: BankTable) -> Numbers:
    numbers = _some(b, "certificates", "window") + _each("width", len(b.signal)) + _some(b, "signal")
    numbers += _each("bank_exponent", b.exponent) + _some(b, "weight", "bias", "widen")
    return numbers + _each("extras", len(b.extra)) + _some(b, "extra") + _each("extra_weight", b.extra_weight if b.extra else ())


def _filter(p: StatisticTable) -> Numbers:
    numbers = _some(p, *FILTER_COUNTS[:3]) + _each("bounded", int(p.bounded)) + _some(p, *FILTER_COUNTS[3:])
    for m in (p.f, p.h):
        numbers += _each("map_width", m.width) + _some(m, "end", "coefficient", "factor")
    numbers += _some(p, *FILTER_WIDE, "parent", "factor", "noise", "moment", "mean", "covariance", "cut_moment", "cut_state", "cut_scale")
    numbers += _some(p, "box", "x0", "P0", "M0", "Q", "R", "range", "fresh", *FILTER_NUMBERS, "signal", "gain")
    return numbers + _each("inputs", len(p.input)) + _some(p, "input", "zero", "drive", "direct", "known", "settle")


def _uncertain(m: MismatchTable | None) -> Numbers:
    if m is None:
        return _each("uncertain", 0)
    return _each("uncertain", 1) + _each("states", len(m.constant)) + _each("width", len(m.signal)) + _each("mismatch_exponent", m.exponent) + _some(m, "signal", "constant", "gain")


def in_steps(value: Any) -> Any:
    """Tables of fixed point with every real number as the integer that C holds."""
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{f.name: in_steps(getattr(value, f.name)) for f in fields(value)})
    if isinstance(value, tuple):
        return tuple(in_steps(v) for v in value)
    if not isinstance(value, float):
        return value
    steps = value * 2.0**31
    assert steps == round(steps) and abs(value) <= 1, value
    return float(min(steps, 2.0**31 - 1))


def expected_numbers(t: Tables) -> Numbers:
    """What has to lie in the structures, from the tables."""
    numbers = _each("signals", t.signals) + _each("all_signals", t.width) + _each("groups", len(t.groups))
    for g in t.groups:
        numbers += _group(g)
    numbers += _each("generators", len(t.generators)) + _each("either", 1) + [p for g in t.generators for p in _generator(g)]
    numbers += _each("predictors", len(t.predictors)) + [p for x in t.predictors for p in _predictor(x)] + _uncertain(t.mismatch)
    numbers += _each("banks", len(t.banks)) + [p for b in t.banks for p in _bank(b)]
    numbers += _each("polynomials", len(t.polynomials)) + [p for f in t.polynomials for p in _filter(f)]
    numbers += _each("decisions", t.judged) + _each("feeds", tuple(g.feeds for g in t.judging)) + _each("faults", tuple(g.faults for g in t.judging))
    numbers += (
        _each("up", t.up) + _each("down", t.down) + _each("latch", int(t.latch)) + _each("history", t.history) + _each("values", t.window) + _each("all_residuals", t.residuals)
    )
    numbers += _each("codes", 2 * t.signals) + _each("reals", t.reals) + _each("sums", t.sums)
    numbers += _each("closing", t.closing) + _message(t.verdict, ()) + _message(t.status, ())
    return numbers + _each("heartbeat", t.heartbeat) + _each("hash", t.hash)


def read_numbers(lines: list[str]) -> Numbers:
    """Of a dump."""
    split = [line.split() for line in lines]
    return [(tag, float.fromhex(text) if "x" in text else float(text)) for tag, text in split]


def tables_in(d: Design, number: str) -> Tables:
    """The numbers of a type."""
    if number != "q31":
        return d.tables
    assert d.tables.fixed is not None
    made = in_steps(d.tables.fixed)
    assert isinstance(made, Tables)
    return replace(made, float_hash=d.tables.hash)


def storage(t: Tables) -> Numbers:
    """What the probe says of the node's memory."""
    return [("needed", float(t.reals)), ("stored", float(t.reals)), ("needed", float(t.sums)), ("stored", float(t.sums))] + [(tag, 1.0) for tag in ("node", "null", "senders", "null")]


@pytest.mark.parametrize("number", REALS)
def test_compiled_tables_hold_the_very_numbers(built: Built, number: str) -> None:
    if not (built.dir / f"probe_{number}").is_file():
        assert number == "q31" and built.design.tables.fixed is None
        return
    tables = tables_in(built.design, number)
    assert read_numbers(built.run(f"probe_{number}", "dump")) == expected_numbers(tables) + storage(tables)


@pytest.fixture(scope="module")
def dumps(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ctypes.CDLL]:
    """What writes the numbers of structures that lie anywhere in memory, by number type."""
    out = tmp_path_factory.mktemp("dump")
    (out / "dump.c").write_text(DUMP + FILED, encoding="ascii")
    made = {}
    for r in REALS:
        command = ["gcc", *WARNINGS, "-shared", "-fPIC", f"-DHG_REAL_{r.upper()}=1", f"-I{ROOT}/firmware/include", str(out / "dump.c"), "-o", str(out / f"dump_{r}.so")]
        subprocess.run(command, check=True)
        made[r] = ctypes.CDLL(str(out / f"dump_{r}.so"))
    return made


@pytest.mark.parametrize(("name", "number"), NUMBERS)
def test_structures_filled_at_run_time_hold_them_too(designs: dict[str, Design], dumps: dict[str, ctypes.CDLL], tmp_path: Path, name: str, number: str) -> None:
    native = Native(library(number), designs[name].tables)
    where = [ctypes.c_void_p(int(native.library.ffi.cast("uintptr_t", p))) for p in (native.node, native.senders)]
    assert dumps[number].filed(str(tmp_path / "numbers").encode(), *where) == 0
    assert read_numbers((tmp_path / "numbers").read_text(encoding="ascii").splitlines()) == expected_numbers(tables_in(designs[name], number))


# --- DBC -------------------------------------------------------------------------------------------------------------------------------


def _sent_value(s: SignalTable, code: int) -> float:
    """The value of a code as an engineer's tool knows it: what the DBC's scale says, or the float32 on the wire."""
    if s.flags & FLOAT32:
        return float(np.float32(s.offset) + np.float32(s.resolution) * np.float32(code))
    return code * short(s.resolution) + short(s.offset)


def _by_id(database: Database, g: GroupTable) -> Message:
    return database.get_message_by_frame_id(g.message.id, force_extended_id=bool(g.message.flags & EXTENDED))


def test_cantools_packs_and_reads_as_the_library_does(built: Built) -> None:
    dice = random.Random(SEED)
    tables = built.design.tables
    asked: list[tuple[int, int, int, list[int]]] = []
    for _ in range(200):
        for i, g in enumerate(tables.groups):
            ends = dice.random() < 0.1
            codes = [dice.choice((s.minimum, s.maximum)) if ends else dice.randint(s.minimum, s.maximum) for s in g.signals]
            asked.append((i, dice.randrange(16), dice.randrange(16), codes))
    given = "".join(f"{i} {c} {k} {' '.join(map(str, codes))}\n" for i, c, k, codes in asked)
    answers = built.run("probe_f32", given=given)
    assert len(answers) == len(asked)
    for (i, counter, stamp, codes), answer in zip(asked, answers, strict=True):
        g, words = tables.groups[i], answer.split()
        data, message = bytes.fromhex(words[0]), _by_id(built.database, g)
        assert [int(w) for w in words[1 : 1 + len(codes)]] == codes
        signals = {s.name: _sent_value(s, code) for s, code in zip(g.signals, codes, strict=True)}
        p, read = g.message.protection, message.decode(data)
        assert isinstance(read, dict)
        places = {name: int.from_bytes(data, "little") >> first & ((1 << bits) - 1) for name, (first, bits) in p.places.items()}
        expected = {"counter": counter % p.modulus if p.modulus else 0, "stamp": stamp, "nibble": p.data_id >> 8}
        header: dict[str, float] = {}
        for place, found in places.items():
            header[FIELDS[place]] = found
            assert read[FIELDS[place]] == found == expected.get(place, found)
        packed = message.encode({**header, **signals}, padding=False, strict=True)
        assert bytes(a | b for a, b in zip(packed, g.message.idle or bytes(len(packed)), strict=True)) == data
        raw = message.decode(data, scaling=False)
        assert isinstance(raw, dict)
        for s, code, value in zip(g.signals, codes, words[1 + len(codes) :], strict=True):
            if not s.flags & FLOAT32:
                assert raw[s.name] == code
            physical = read[s.name]
            assert isinstance(physical, (int, float))
            assert abs(physical - float.fromhex(value)) <= 2.0**-22 * max(abs(physical), abs(s.offset), s.resolution)
            assert round((physical - s.offset) / s.resolution) == code


def test_no_value_reads_as_invalid(built: Built) -> None:
    invalid = -(2**31)
    for i, g in enumerate(built.design.tables.groups):
        answer = built.run("probe_f32", given=f"{i} 0 0 {' '.join([str(invalid)] * len(g.signals))}\n")[0]
        read = _by_id(built.database, g).decode(bytes.fromhex(answer.split()[0]))
        assert isinstance(read, dict)
        for s in g.signals:
            value = read[s.name]
            assert np.isnan(float(str(value))) if s.flags & FLOAT32 else str(value) == "invalid"


def test_dbc_says_how_frames_are_sent(built: Built) -> None:
    tables, model = built.design.tables, built.design.model
    sample_ms = model.sample_time_s * 1000
    for place, g in enumerate(tables.groups):
        m = _by_id(built.database, g)
        assert m.dbc is not None
        assert (m.frame_id, m.length) == (g.message.id, g.message.length)
        assert (m.is_extended_frame, m.is_fd) == (bool(g.message.flags & EXTENDED), bool(g.message.flags & FD))
        assert m.send_type == ("Cyclic" if g.periodic else "Event")
        assert m.cycle_time == round(g.interval_max * sample_ms)
        assert m.senders == [f"{m.name}_sender"]
        attributes = {key: a.value for key, a in m.dbc.attributes.items()}
        p = g.message.protection
        assert attributes["E2EProfile"] == PROFILES.index(p.profile) and attributes["E2EDataIdMode"] == MODES.index(p.mode)
        assert tuple(int(x, 16) for x in str(attributes["E2EDataIdList"]).split()) == p.data_ids and attributes["E2EDataId"] == p.data_id
        places = [attributes[f"E2E{key}"] for key in ("CrcByte", "CounterBit", "NibbleBit", "StampBit")]
        assert places == [p.crc, p.counter, p.nibble, p.stamp if p.stamped else -1]
        assert attributes["VFrameFormat"] == (14 if g.message.flags & FD else 0) + (1 if g.message.flags & EXTENDED else 0)
        assert ("closes the sample" in str(m.comment)) == (place == tables.closing)
        for s in g.signals:
            found = m.get_signal_by_name(s.name)
            assert found.conversion.is_float == bool(s.flags & FLOAT32)
            assert found.byte_order == ("big_endian" if s.flags & MOTOROLA else "little_endian")
            assert (found.start, found.length, found.unit) == (s.start, s.length, UNITS[s.name.rsplit("_", 1)[1]])
            assert found.minimum == pytest.approx(s.offset + s.minimum * s.resolution, rel=1e-6)
            assert found.maximum == pytest.approx(s.offset + s.maximum * s.resolution, rel=1e-6)
            if not s.flags & FLOAT32:
                assert found.is_signed == bool(s.flags & SIGNED)
                assert np.float32(found.scale) == s.resolution and np.float32(found.offset) == s.offset
    nodes = {n.name for n in built.database.nodes}
    asks = {"tester"} if tables.freeze is not None else set()
    assert nodes == {"detector", *asks, *(_by_id(built.database, g).senders[0] for g in tables.groups)}


def test_verdict_and_status_read_as_the_node_wrote_them(built: Built) -> None:
    database, tables = built.database, built.design.tables
    lines = [line.split() for line in built.run("report_f32")]
    assert [int(i) for _, i in lines] == [tables.verdict.id, tables.status.id, tables.verdict.id]
    first, status, reply = (database.decode_message(int(i), bytes.fromhex(data)) for data, i in lines)
    assert isinstance(first, dict) and isinstance(status, dict) and isinstance(reply, dict)
    verdict = database.get_message_by_frame_id(tables.verdict.id)
    faults = [s.name for s in verdict.signals if s.name.startswith("fault_")]
    buses = [s.name for s in verdict.signals if s.name.startswith("bus_")]
    assert len(faults) == len(built.design.model.faults) and len(buses) == len(tables.groups)
    assert str(first["plant"]) == "confirmed" and str(first["basis"]) == "set" and str(first["refused"]) == "yes"
    assert [str(first[f]) for f in faults] == ["candidate"] + ["no"] * (len(faults) - 1)
    assert [str(first[b]) for b in buses] == ["stale", "lossy", "good", "absent", "absent"][: len(buses)]  # 0x1B, two bits each
    assert int(str(first["sample_high"])) + int(str(first["E2E_stamp"])) == 0xABC
    assert (str(first["reply"]), str(reply["reply"])) == ("no", "yes")
    assert (first["E2E_counter"], reply["E2E_counter"]) == (0, 1)
    assert status["model_hash"] == tables.hash
    assert (status["frames_lost"], status["frames_refused"]) == (0, 0)
