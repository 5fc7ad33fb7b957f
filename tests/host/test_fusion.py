"""Event-triggered fusion: the numbers of the method's design, the acceptance numbers of its study with controls that must be worse, float32 beside float64,
and frames as long as they are on the wire.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from host_support import SEED
from hullguard.campaign import fusion_study as study
from hullguard.core.fusion import Bench, Case, Filter
from hullguard.core.library import library
from hullguard.design import fusion as design
from hullguard.errors import InputError

def hold(checks: Iterable[study.Check]) -> None:
    """All of them, with what each found."""
    found = list(checks)
    assert found
    assert all(c.passed for c in found), "\n" + "\n".join(str(c) for c in found)


# ---- design: section 3 ----


@pytest.fixture(scope="module")
def made() -> design.MeanField:
    return design.allocate(study.tracking(0.1), study.RATE, study.WEIGHT)


@pytest.fixture(scope="module")
def tracking() -> study.Study:
    return study.Study(0.1, study.QUICK, SEED)


def test_the_allocation_is_the_methods(made: design.MeanField) -> None:
    np.testing.assert_allclose(made.rates, (0.429, 0.087, 0.691, 0.458, 0.435), atol=1e-3)
    np.testing.assert_allclose(made.delta, (0.790, 1.709, 0.398, 0.743, 0.781), atol=1e-3)
    coarse = design.allocate(study.tracking(1.0), study.RATE, study.WEIGHT)
    np.testing.assert_allclose(coarse.delta, (0.385, 1.416, 0.329, 0.865, 1.584), atol=1e-3)


@pytest.mark.parametrize(
    ("loss", "expected"),
    [
        (0.0, (0.8086, 0.3470, 0.9484, 0.8292, 0.8127)),
        (0.05, (0.7403, 0.3281, 0.8104, 0.7559, 0.7435)),
        (0.10, (0.6768, 0.3093, 0.6976, 0.6882, 0.6792)),
        (0.15, (0.6176, 0.2908, 0.6037, 0.6257, 0.6193)),
    ],
)
def test_what_silence_is_worth_is_the_methods(made: design.MeanField, loss: float, expected: tuple[float, ...]) -> None:
    np.testing.assert_allclose([design.beta(float(d), loss) for d in made.delta], expected, atol=4e-4)


def test_what_silence_is_worth_is_the_variance_that_it_takes_away() -> None:
    """Drawn, not integrated: among a million normal numbers, those that a sensor would keep silent about."""
    rng = np.random.default_rng(SEED)
    z, lost, u = rng.standard_normal(1_000_000), rng.random(1_000_000), rng.random(1_000_000)
    for loss in (0.0, 0.15):
        for delta in (0.4, 1.0, 1.7):
            silent = (np.abs(z) < delta) | (lost < loss)
            assert abs(1.0 - z[silent].var() - design.beta(delta, loss)) < 0.01
        for level in (0.5, 2.0):
            silent = (u < np.exp(-0.5 * level * z**2)) | (lost < loss)
            assert abs(1.0 - z[silent].var() - design.beta_stochastic(level, loss)) < 0.01


def test_an_even_share_and_other_shares_are_worse(made: design.MeanField) -> None:
    model = study.tracking(0.1)
    rng = np.random.default_rng(SEED)
    for _ in range(20):
        other = np.clip(made.rates + rng.uniform(-0.1, 0.1, 5), 0.02, 0.95)
        other *= study.RATE / other.mean()
        if other.max() < design.RATE_MAX:
            assert design.mean_field(model, other).rms(study.POSITION) >= made.rms(study.POSITION) * (1 - 1e-6)
    assert design.mean_field(model, [study.RATE] * 5).rms(study.POSITION) > 1.02 * made.rms(study.POSITION)


def test_the_trade_off_is_the_methods() -> None:
    model = study.tracking(0.1)
    all_frames = design.mean_field(model, [1.0] * 5).rms(study.POSITION)
    found = [design.allocate(model, rate, study.WEIGHT).rms(study.POSITION) / all_frames for rate in (0.6, 0.2)]
    np.testing.assert_allclose(found, (1.010, 1.175), atol=0.004)


def test_a_set_with_a_dead_sensor_has_its_own_table(tracking: study.Study) -> None:
    tables = tracking.masked.tables
    assert [t.alive for t in tables] == [31, 30, 29, 27, 23, 15]
    for table in tables:
        alive = [i for i in range(5) if table.alive >> i & 1]
        rates = [design.rate_of(float(np.sqrt(table.level[i]))) for i in alive]
        assert np.mean(rates) == pytest.approx(study.RATE * 5 / len(alive), abs=1e-3)
        assert all((table.relax[0][i] > 0.0) == (i in alive) for i in range(5))
        assert all(a <= b for low, high in zip(table.relax, table.relax[1:], strict=False) for a, b in zip(low, high, strict=True))


def test_a_schedule_repeats_and_keeps_to_its_rate() -> None:
    plan = design.scheduled(study.tracking(0.1), 0.44)
    assert 0.42 < plan.rate <= 0.44
    assert len(plan.sends) == plan.period


def test_what_cannot_be_designed_is_refused_in_one_line() -> None:
    model = study.tracking(0.1)
    blind = design.Fusion(model.A, model.Q, model.C[:2], model.R[:2], model.x0, model.P0)  # nobody sees py
    for attempt in (
        lambda: design.allocate(model, 0.001, study.WEIGHT),
        lambda: design.mean_field(blind, [0.4, 0.4]),
        lambda: design.Fusion(model.A, model.Q, model.C, model.R[:4], model.x0, model.P0),
        lambda: design.Fusion(model.A, model.Q, model.C, model.R * 0.0, model.x0, model.P0),
        lambda: design.Fusion(model.A, model.Q, np.ones((17, 4)), np.ones(17), model.x0, model.P0),
    ):
        with pytest.raises(InputError) as error:
            attempt()
        assert "\n" not in str(error.value)


# ---- the study: section 9 ----


def test_frames_and_errors_without_losses(tracking: study.Study) -> None:
    hold(study.budget(tracking, study.Study(1.0, study.QUICK, SEED)))


def test_losses_and_consistency(tracking: study.Study) -> None:
    hold(study.losses(tracking))


def test_what_must_be_worse_is_worse(tracking: study.Study) -> None:
    hold(study.controls(tracking))


def test_no_trigger_beats_periodic_sending(tracking: study.Study) -> None:
    hold(study.triggers(tracking))


def test_a_dead_sensor_and_outliers(tracking: study.Study) -> None:
    hold(study.dead_sensor(tracking))
    hold(study.outliers(tracking))


def test_late_frames() -> None:
    hold(study.late_frames(study.Study(study.STEP, study.QUICK, SEED)))


def test_a_manoeuvre_and_a_centre_that_loses_frames(tracking: study.Study) -> None:
    hold(study.manoeuvre(tracking))
    hold(study.one_sided_loss(tracking))


def test_origins_that_differ_do_not_matter_to_codes_that_wrap(tracking: study.Study) -> None:
    """A target that starts beside a step of the origin: a centre that loses frames takes the step in another sample than the sensors do."""
    m = tracking.model
    beside = design.Fusion(m.A, m.Q, m.C, m.R, m.x0 + np.array([118.0, 0.0, 118.0, 0.0]), m.P0)
    case = Case(loss=0.15, lossy="centre", nodes=2, resolution=study.WIRE, recall=True)
    sensor = Filter((tracking.table(),), origin=study.ORIGIN)
    found = Bench(library("f32"), beside).run(replace(sensor, depth=8), case, 100, SEED, sensor)
    assert found.origins > 100
    assert tracking.ratio(found) < 1.18


def test_all_nodes_are_in_the_same_state(tracking: study.Study) -> None:
    hold(study.same_state(tracking))


def test_faulty_sensors_are_blamed_and_good_ones_are_not(tracking: study.Study) -> None:
    hold(study.judgement(tracking))


def test_a_blamed_sensor_is_taken_out_in_all_nodes(tracking: study.Study) -> None:
    """With the best sensor biased for good, the estimate comes back to what the others allow, and stays consistent."""
    fault = {"samples": 400, "skip": 250, "fault": "bias", "fault_sensor": 2, "fault_size": 10 * study.SIGMA[2], "fault_at": 100, "nodes": 6}
    kept = tracking.run(tracking.masked, runs=100, **fault)
    out = tracking.run(tracking.masked, runs=100, judge=study.JUDGE, exclude=True, **fault)
    assert out.consistency < 4.6
    assert kept.consistency > 20.0
    assert out.unequal == 0


def test_copies_that_do_not_hear_the_same_frames_differ(tracking: study.Study) -> None:
    """The comparison of nodes can fail: late frames without `delay` are booked by some nodes in time, by others not."""
    found = tracking.run(Filter((tracking.table(),), depth=1), runs=2, late=0.5, nodes=6)
    assert found.unequal > 0


# ---- numbers: sections 4, 7 ----


@pytest.mark.parametrize(("offset", "rows"), [(0.0, False), (5000.0, False), (0.0, True)])
def test_float32_is_as_good_as_float64(tracking: study.Study, offset: float, rows: bool) -> None:
    hold(study.precision(tracking, study.QUICK.long, offset, rows))


def test_errors_of_float32_and_float64_are_equal(tracking: study.Study) -> None:
    hold(study.same_errors(tracking))


def test_the_local_origin_keeps_float32_as_good_far_away() -> None:
    """155 km off float32 resolves 16 mm, a tenth of a sensor's noise; with the origin the estimate is what it is at home."""
    model = study.tracking(0.1)
    far = design.Fusion(model.A, model.Q, model.C, model.R, np.array([155000.0, 1.0, 155000.0, 0.5]), model.P0)
    made = design.allocate(model, study.RATE, study.WEIGHT)
    table = design.innovation_table(model, made.delta, made.rates)
    case = Case(samples=400)
    home = Bench(library("f32"), model).run(Filter((table,)), case, 50, SEED)
    local = Bench(library("f32"), far).run(Filter((table,), origin=study.ORIGIN), case, 50, SEED)
    assert local.origins > 0
    assert local.largest < 3 * study.ORIGIN[0]
    assert local.rms(study.POSITION) == pytest.approx(home.rms(study.POSITION), rel=0.01)


def test_frames_are_as_long_as_they_are_on_the_wire(tracking: study.Study) -> None:
    """Exact lengths between no stuff bits and the most; 16 bits of 5 mm cost nothing in error."""
    rows = list(study.wire(tracking))
    assert [r.length for r in rows] == [6, 6, 4, 4]
    for row in rows:
        assert row.rate * (47 + 8 * row.length) < row.exact < row.worst
    for periodic, event in (rows[:2], rows[2:]):
        assert event.exact / periodic.exact < 0.44
        assert event.worst / periodic.worst < 0.44
    for wide, short in zip(rows[:2], rows[2:], strict=True):
        assert short.position == pytest.approx(wide.position, abs=0.003)
