"""Roads: their spectrum against ISO 8608, their derivatives, what a model promises of them."""

from __future__ import annotations

import numpy as np
import pytest
from host_support import SEED
from hullguard.errors import InputError
from hullguard.model.road import CLASSES, RoadSpec, read_road
from hullguard.model.table import Table
from hullguard.plant.road import check_bounds, random_road, road


@pytest.mark.parametrize("roughness", sorted(CLASSES))
def test_spectrum_of_a_class(roughness: str) -> None:
    """Height of many roads by periodogram, octave by octave, against 16 .. 4096e-6 (n / 0.1)^-2."""
    speed, period, count = 20.0, 2e-3, 2**14
    t = np.arange(count) * period
    window = np.hanning(count)
    mean = np.zeros(count // 2 + 1)
    for run in range(12):
        velocity = random_road(roughness, speed, SEED + run).velocity(t)
        mean += np.abs(np.fft.rfft(velocity * window)) ** 2 * 2 * period / (window**2).sum() / 12
    f = np.fft.rfftfreq(count, period)
    for low in (1.0, 2.0, 4.0, 8.0, 16.0):
        band = (f >= low) & (f < 2 * low)
        # Velocity in time: (2 pi f)^2 Gd(f / v) / v, which is the same at every frequency.
        expected = (2 * np.pi) ** 2 * CLASSES[roughness] * 0.01 * speed
        assert np.mean(mean[band]) == pytest.approx(expected, rel=0.15), f"octave above {low} Hz"
    assert np.all(mean[f > 60.0] < 1e-3 * mean[(f > 2) & (f < 50)].mean())  # 2.83 1/m at 20 m/s is 56.6 Hz


def test_same_seed_same_road() -> None:
    t = np.linspace(0.0, 5.0, 100)
    one, same, other = (random_road("B", 15.0, s).velocity(t) for s in (3, 3, 4))
    assert np.array_equal(one, same) and not np.allclose(one, other)


@pytest.mark.parametrize("spec", [RoadSpec("smooth"), RoadSpec("sine", 0.02, 1.5), RoadSpec("bump", 0.05), RoadSpec("iso8608", roughness="C")])
def test_acceleration_is_the_derivative(spec: RoadSpec) -> None:
    made = road(spec, SEED)
    t = np.linspace(0.9, 1.2, 30_001)
    slope = (made.velocity(t + 5e-7) - made.velocity(t - 5e-7)) / 1e-6
    inside = (np.abs(t - 1.0) > 1e-5) & (np.abs(t - 1.1) > 1e-5)
    assert np.allclose(slope[inside], made.acceleration(t)[inside], rtol=1e-4, atol=1e-4)


def test_heights() -> None:
    t = np.linspace(0.0, 2.0, 200_001)
    bump = road(RoadSpec("bump", 0.05, start_s=1.0, duration_s=0.1), 1).velocity(t)
    height = np.cumsum(bump) * (t[1] - t[0])
    assert height.max() == pytest.approx(0.05, rel=1e-3) and abs(height[-1]) < 1e-6
    assert np.abs(bump).max() == pytest.approx(0.025 * 2 * np.pi / 0.1, rel=1e-4)
    assert np.abs(road(RoadSpec("sine", 0.02, 1.0), 1).velocity(t)).max() == pytest.approx(0.04 * np.pi, rel=1e-6)
    assert not road(RoadSpec("smooth"), 1).velocity(t).any()


def test_a_road_that_breaks_the_promise_is_refused() -> None:
    t = np.linspace(0.0, 5.0, 10_001)
    bump = road(RoadSpec("bump", 0.05), 1)
    check_bounds([bump], t, 1.6, 100.0)
    with pytest.raises(InputError, match=r"reaches 1\.57 m/s, the model promises at most 1; .*plant.unknown.bound"):
        check_bounds([bump], t, 1.0, 100.0)
    with pytest.raises(InputError, match=r"reaches 98\.7 m/s2, the model promises at most 90; .*plant.unknown.rate"):
        check_bounds([bump], t, 1.6, 90.0)


def test_reading() -> None:
    assert read_road(Table({"kind": "iso8608", "class": "E", "speed_mps": 5}, "road")) == RoadSpec("iso8608", roughness="E", speed_mps=5.0)
    assert read_road(Table({"kind": "bump", "height_m": 0.05, "duration_s": 0.2}, "road")) == RoadSpec("bump", 0.05, duration_s=0.2)
    assert read_road(Table({"kind": "smooth"}, "road")) == RoadSpec("smooth")
    for wrong, message in (
        ({"kind": "gravel"}, "'gravel' is not one of smooth, sine, bump, iso8608"),
        ({"kind": "iso8608", "class": "F"}, "'F' is not one of A, B, C, D, E"),
        ({"kind": "sine", "height_m": 1, "frequency_hz": 1, "class": "A"}, "unknown key 'class'"),
        ({"kind": "bump", "duration_s": 1}, "'height_m' is missing"),
    ):
        with pytest.raises(InputError, match=message):
            read_road(Table(wrong, "road"))
