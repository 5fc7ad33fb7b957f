"""Whatever is wrong with what a user gives: the exit status of DESIGN.md, one line that names the cause and the cure, never a traceback. Whatever is
wrong with a frame: refused, counted, and no verdict relies on it.
"""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from host_support import ROOT, SEED, Cli, Models, Result
from hullguard.core.library import library
from hullguard.core.native import REST, Frame, Node, Plant, Sender
from hullguard.errors import InputError
from hullguard.model import load_model, parse_fault, parse_override
from hullguard.model.schema import SHIPPED, parse_model
from hullguard.model.templates import expand
from hypothesis import given, settings
from hypothesis import strategies as st

PLATOON = (SHIPPED / "platoon.toml").read_text(encoding="utf-8")
DESIGNED = (SHIPPED / "platoon.design.toml").read_text(encoding="utf-8")
DONE, FAILED, BAD, NO_BUS = 0, 1, 2, 3


def refused(result: Result, status: int, *words: str) -> str:
    """The one line on stderr."""
    assert result.status == status, result
    assert "Traceback" not in result.err
    lines = result.err.strip().splitlines()
    assert len(lines) == 1, result.err
    for word in words:
        assert word in lines[0], lines[0]
    return lines[0]


@pytest.fixture
def data() -> dict[str, Any]:
    return expand(tomllib.loads(PLATOON), "platoon.toml")


@pytest.fixture
def given_model(tmp_path: Path, cli: Cli) -> Any:
    """Runs a command on a changed platoon, its design file beside it."""

    def run(changed: dict[str, Any] | str, *arguments: object, command: str = "run") -> Result:
        path = tmp_path / "mine.toml"
        path.write_text(changed if isinstance(changed, str) else tomli_w.dumps(changed), encoding="utf-8")
        (tmp_path / "mine.design.toml").write_text(DESIGNED, encoding="utf-8")
        more = arguments or ("--bus", "inprocess", "--samples", 10, "--no-fault", "-q")
        return cli(command, path, *more)

    return run


def test_the_model_that_the_others_are_made_from_is_good(given_model: Any, data: dict[str, Any]) -> None:
    assert given_model(data).status == DONE
    assert given_model(PLATOON).status == DONE


# ---- model files ----


def test_no_truncated_model_is_read() -> None:
    """Every prefix: either the same model but for what follows it, or refused."""
    complete = tomllib.loads(PLATOON)
    whole = 0
    for end in range(len(PLATOON)):
        try:
            found = tomllib.loads(PLATOON[:end])
        except tomllib.TOMLDecodeError:
            continue
        try:
            parse_model(found, Path("cut.toml"))
            whole += 1
        except InputError as error:
            assert "\n" not in str(error)
            assert "cut.toml" in str(error)
    assert parse_model(complete, Path("cut.toml")).name == "platoon"
    assert whole < len(PLATOON) // 4, "scenarios and faults may be missing at the end, nothing else"


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.5, 0.7])
def test_a_truncated_file_is_refused_by_the_command(given_model: Any, share: float) -> None:
    refused(given_model(PLATOON[: int(share * len(PLATOON))]), BAD, "mine.toml")


UNKNOWN = [
    (("sample_tims_s",), "sample_time_s"),
    (("bus", "bitrate"), "bitrate_bps"),
    (("plant", "vehicle"), "vehicles"),
    (("plant", "feedback", "state_weight"), "state_weights"),
    (("plant", "disturbance", "states"), "state"),
    (("signals", 0, "resolutions"), "resolution"),
    (("groups", 0, "signal"), "signals"),
    (("groups", 0, "trigger", "sigmas"), "sigma"),
    (("groups", 0, "frame", "ids"), "id"),
    (("verdict", "heartbeat"), "heartbeat_samples"),
    (("verdict", "debounce", "ups"), "up"),
    (("detector", "observer"), "observers"),
    (("detector", "observers", 0, "residual"), "residuals"),
    (("detector", "observers", 0, "search", "trial"), "trials"),
    (("faults", 0, "kind"), "name"),
    (("scenarios", 0, "sample"), "samples"),
    (("scenarios", 0, "reference", "amplitud"), "amplitude"),
]


def at(data: Any, path: tuple[Any, ...]) -> Any:
    for part in path:
        data = data[part]
    return data


@pytest.mark.parametrize(("path", "meant"), UNKNOWN, ids=[".".join(map(str, p)) for p, _ in UNKNOWN])
def test_an_unknown_key_is_refused_with_a_suggestion(given_model: Any, data: dict[str, Any], path: tuple[Any, ...], meant: str) -> None:
    at(data, path[:-1])[path[-1]] = 1
    text = refused(given_model(data), BAD, f"'{path[-1]}'", "unknown key")
    assert f"did you mean '{meant}'" in text or f"{meant}" in text.split("known: ")[-1]


MISSING = [
    ("schema",), ("name",), ("kind",), ("sample_time_s",), ("plant",), ("signals",), ("groups",), ("verdict",), ("detector",),
    ("plant", "builder"), ("plant", "vehicles"), ("plant", "drag_per_s"), ("signals", 0, "name"), ("signals", 0, "role"), ("signals", 0, "range"),
    ("signals", 0, "resolution"), ("groups", 0, "name"), ("groups", 0, "frame"), ("groups", 0, "frame", "id"), ("groups", 0, "trigger"),
    ("groups", 0, "trigger", "interval_max"), ("groups", 0, "trigger", "sigma"), ("groups", 0, "trigger", "delta"), ("verdict", "frame"),
    ("detector", "observers"), ("detector", "observers", 0, "order"), ("detector", "observers", 0, "residuals"), ("faults", 0, "signal"), ("faults", 0, "type"),
    ("scenarios", 0, "samples"),
]  # fmt: skip


@pytest.mark.parametrize("path", MISSING, ids=[".".join(map(str, p)) for p in MISSING])
def test_a_missing_entry_is_named(given_model: Any, data: dict[str, Any], path: tuple[Any, ...]) -> None:
    del at(data, path[:-1])[path[-1]]
    words = () if path in {("plant", "builder")} else (f"'{path[-1]}' is missing",)
    refused(given_model(data), BAD, "mine.toml", *words)


NUMBERS = [
    ("sample_time_s",), ("bus", "bitrate_bps"), ("plant", "vehicles"), ("plant", "drag_per_s"), ("plant", "initial_range"), ("plant", "disturbance", "state"),
    ("plant", "feedback", "reference_bound"), ("signals", 0, "resolution"), ("signals", 0, "range"), ("groups", 0, "frame", "id"), ("groups", 0, "trigger", "sigma"),
    ("groups", 0, "trigger", "interval_max"), ("groups", 0, "trigger", "silence"), ("groups", 0, "trigger", "delta"), ("verdict", "heartbeat_samples"),
    ("verdict", "debounce", "up"), ("detector", "observers", 0, "order"), ("detector", "observers", 0, "search", "trials"), ("scenarios", 0, "samples"),
    ("scenarios", 0, "reference", "amplitude"),
]  # fmt: skip
NO_NUMBERS = [float("nan"), float("inf"), "1.0", True, {}, [[1.0]], [], -1e30, ["a", "b"], [float("nan")] * 3, 10**400, 1e300]


@pytest.mark.parametrize("path", NUMBERS, ids=[".".join(map(str, p)) for p in NUMBERS])
@pytest.mark.parametrize("value", NO_NUMBERS, ids=[str(v)[:20] for v in NO_NUMBERS])
def test_what_is_no_number_is_refused_where_a_number_belongs(data: dict[str, Any], path: tuple[Any, ...], value: Any) -> None:
    at(data, path[:-1])[path[-1]] = value
    with pytest.raises(InputError) as caught:
        parse_model(data, Path("mine.toml"))
    assert str(path[-1]) in str(caught.value)
    assert "\n" not in str(caught.value)


SHAPES = [
    (("plant", "initial_range"), [0.5] * 4, "5 numbers"),
    (("plant", "feedback", "state_weights"), [1.0] * 6, "5 numbers"),
    (("plant", "feedback", "input_weights"), [1.0] * 2, "3 numbers"),
    (("plant", "disturbance", "state"), [[0.1, 0.2], [0.1]], "rows of equal length"),
    (("plant", "disturbance", "state"), [[0.1]] * 4, "5 x any"),
    (("groups", 0, "trigger", "sigma"), [0.05, 0.05], "3 numbers"),
    (("groups", 0, "trigger", "delta"), [0.1, 0.05], "smallest, largest"),
    (("groups", 0, "trigger", "silence"), 5, "outside"),
    (("groups", 0, "trigger", "sigma"), 0.0001, "half its resolution"),
    (("signals", 0, "range"), [1.0, -1.0], "not below"),
    (("signals", 0, "slew"), [0.5, 0.1], "none smaller"),
    (("signals", 0, "slew"), "slow", "reachable"),
    (("signals", 0, "role"), "sensor", "output"),
    (("groups", 0, "signals"), ["gap12_m", "gap23_m", "speed9_mps"], "speed9_mps"),
    (("groups", 0, "frame", "id"), 0x800, "outside"),
    (("groups", 0, "transmission"), "sometimes", "event, tick, periodic"),
    (("groups", 1, "transmission"), "periodic", "exactly one group closes"),
    (("groups", 0, "frame", "id"), 0x121, "larger identifier"),
    (("groups", 0, "frame", "protection"), "P77", "P22"),
    (("faults", 0, "type"), "software", "actuator, sensor"),
    (("faults", 3, "type"), "actuator", "is an output"),
    (("faults", 0, "signal"), "gap99_m", "gap99_m"),
    (("detector", "observers", 0, "outputs"), ["gap99_m"], "gap99_m"),
    (("detector", "observers", 0, "faults"), ["gap99_m"], "gap99_m"),
    (("detector", "observers"), [], "residual generators"),
    (("detector", "observers", 0, "search", "poles"), [0.0, 1.0], "unit circle"),
    (("detector", "observers", 0, "search", "poles"), [-1.2, 0.5], "unit circle"),
    (("detector", "observers", 0, "search", "poles"), [0.5, 0.1], "unit circle"),
    (("schema",), 2, "schema 1"),
    (("kind",), "cubic", "linear"),
    (("name",), "Platoon 1", "identifier"),
    (("plant", "builder"), "string_of_pearls", "string_of_vehicles"),
    (("plant", "vehicles"), 4, "inputs are"),
    (("signals", 0, "name"), "gap13_m", "gap12_m"),
    (("scenarios", 0, "faults"), ["controller2:bias@150"], "needs a size"),
    (("scenarios", 0, "reference", "kind"), "zigzag", "steps"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "word"), SHAPES, ids=[f"{'.'.join(map(str, p))}={v}" for p, v, _ in SHAPES])
def test_a_wrong_shape_or_choice_is_refused_and_what_would_do_is_named(given_model: Any, data: dict[str, Any], path: tuple[Any, ...], value: Any, word: str) -> None:
    at(data, path[:-1])[path[-1]] = value
    refused(given_model(data), BAD, word)


@pytest.mark.parametrize("members", [["gap12_m", "gap23_m"], ["gap12_m", "gap23_m", "speed1_mps", "speed1_mps"]])
def test_a_signal_in_no_group_or_in_one_twice_is_refused(given_model: Any, data: dict[str, Any], members: list[str]) -> None:
    data["groups"][0]["signals"] = members
    data["groups"][0]["trigger"]["sigma"] = 0.05
    refused(given_model(data), BAD, "mine.toml", "speed1_mps")


TWICE = [
    ("signals", "name", "gap23_m"), ("groups", "name", "control"), ("faults", "name", "controller2"), ("faults", "name", "gap12_m"), ("scenarios", "name", "rest"),
]  # fmt: skip


@pytest.mark.parametrize(("table", "key", "value"), TWICE)
def test_a_name_that_is_there_twice_is_refused(given_model: Any, data: dict[str, Any], table: str, key: str, value: str) -> None:
    data[table][0][key] = value
    refused(given_model(data), BAD, value)


@pytest.mark.parametrize(("path", "value"), [(("groups", 1), 0x110), (("verdict",), 0x110), (("verdict",), 0x120)])
def test_an_identifier_that_is_there_twice_is_refused(given_model: Any, data: dict[str, Any], path: tuple[Any, ...], value: int) -> None:
    at(data, path)["frame"]["id"] = value
    refused(given_model(data), BAD, f"0x{value:X}")


def test_two_messages_with_one_data_id_are_refused(given_model: Any, data: dict[str, Any]) -> None:
    data["groups"][0]["frame"]["data_id"] = 7
    data["groups"][1]["frame"]["data_id"] = 7
    refused(given_model(data), BAD, "data_id")


# ---- designs that cannot be sound ----


def dense(**changes: Any) -> dict[str, Any]:
    """A small model with matrices of its own."""
    made: dict[str, Any] = {
        "schema": 1, "name": "small", "kind": "linear", "sample_time_s": 0.1,
        "plant": {
            "A": [[0.9, 0.1], [0.0, 0.8]], "B": [[0.0], [0.1]], "C": [[1.0, 0.0]], "discrete": True, "initial_range": [0.1, 0.1],
            "disturbance": {"state": 0.01, "output": 0.01}, "feedback": {"gain": [[0.0, 0.0]], "reference_bound": 1.0},
        },
        "signals": [
            {"name": "y", "role": "output", "range": [-10.0, 10.0], "resolution": 0.001, "slew": "reachable"},
            {"name": "u", "role": "input", "range": [-2.0, 2.0], "resolution": 0.001, "slew": "reachable"},
        ],
        "groups": [
            {"name": "sensor", "signals": ["y"], "frame": {"id": 0x10}, "trigger": {"delta": 0.0, "sigma": 0.05, "interval_max": 5}},
            {"name": "control", "signals": ["u"], "frame": {"id": 0x20}, "transmission": "tick", "applied_as_sent": True},
        ],
        "verdict": {"frame": {"id": 0x30}},
        "detector": {"observers": [{"order": 2, "residuals": 1, "search": {"trials": 5}}]},
    }  # fmt: skip
    for key, value in changes.items():
        place, *rest = key.split("__")
        made[place] = made[place] if rest else value
        if rest:
            at(made[place], tuple(int(r) if r.isdigit() else r for r in rest[:-1]))[rest[-1]] = value
    return made


@pytest.fixture
def own_model(tmp_path: Path, cli: Cli) -> Any:
    def run(source: dict[str, Any]) -> Result:
        path = tmp_path / "small.toml"
        path.write_text(tomli_w.dumps(source), encoding="utf-8")
        return cli("run", path, "--bus", "inprocess", "--samples", 20, "-q")

    return run


def test_the_small_model_is_good(own_model: Any) -> None:
    assert own_model(dense()).status == DONE


def test_an_unobservable_plant_is_refused_and_the_hidden_state_named(own_model: Any) -> None:
    source = dense(plant__A=[[0.9, 0.0], [0.0, 0.8]], plant__states=["seen", "hidden"])
    refused(own_model(source), BAD, "not observable", "'hidden'", "measure it")


def test_two_equal_outputs_are_refused(given_model: Any) -> None:
    source = dense(plant__C=[[1.0, 0.0], [2.0, 0.0]])
    source["signals"].insert(1, source["signals"][0] | {"name": "y2"})
    source["groups"][0]["signals"] = ["y", "y2"]
    source["groups"][0]["trigger"]["sigma"] = 0.05
    with pytest.raises(InputError, match="drop one"):
        from hullguard.design.design import design

        design(parse_model(source, Path("small.toml")), fresh=True)
    assert given_model(source).status == BAD


def test_an_order_without_a_parity_vector_is_refused_and_the_one_that_would_do_is_named(own_model: Any) -> None:
    text = refused(own_model(dense(detector__observers__0__order=1)), BAD, "no parity vector at order 1")
    assert "smallest order that has one is 2" in text


def test_an_unstable_plant_without_declared_slews_is_refused(own_model: Any) -> None:
    refused(own_model(dense(plant__A=[[1.1, 0.1], [0.0, 0.8]])), BAD, "stable loop")


def test_a_reach_beyond_the_range_is_refused_and_the_range_that_would_do_is_named(own_model: Any) -> None:
    text = refused(own_model(dense(signals__0__range=[-0.05, 0.05])), BAD, "reach of y", "make its range")
    low, high = (float(x) for x in text.split("make its range ")[1].split(" or wider")[0].split(" .. "))
    assert own_model(dense(signals__0__range=[1.01 * low, 1.01 * high])).status == DONE


@pytest.mark.parametrize("low_high", [[-1e6, 1e6], [-20000.0, 20000.0]])
def test_a_range_that_does_not_fit_its_frame_is_refused(own_model: Any, low_high: list[float]) -> None:
    refused(own_model(dense(signals__0__range=low_high, signals__0__resolution=1e-3 if low_high[1] < 1e6 else 1e-6)), BAD, "coarser")


def test_a_group_that_does_not_fit_its_frame_is_refused_with_the_way_out(given_model: Any, data: dict[str, Any]) -> None:
    data["signals"][0]["resolution"] = data["signals"][1]["resolution"] = data["signals"][2]["resolution"] = 1e-5
    data["groups"][0]["frame"]["fd"] = False
    refused(given_model(data), BAD, "'measurement'", "fd = true")
    data["groups"][0]["frame"]["fd"] = True
    assert given_model(data).status == DONE


def test_an_overloaded_bus_is_refused(given_model: Any, data: dict[str, Any]) -> None:
    data["bus"]["bitrate_bps"] = 10_000
    assert given_model(data).status == DONE
    own = dense(sample_time_s=0.01, bus={"bitrate_bps": 10_000})
    refused(given_model(own), BAD, "bus load", "bitrate_bps")


def test_a_counter_that_hides_sixteen_lost_frames_is_refused_and_the_limit_named(given_model: Any, data: dict[str, Any]) -> None:
    data["groups"][0]["trigger"] |= {"interval_max": 12, "margin": 4}
    refused(given_model(data), BAD, "'measurement'", "16", "15")
    data["groups"][0]["trigger"]["margin"] = 3
    assert given_model(data).status == DONE


def test_a_broken_design_file_is_refused_or_made_anew(tmp_path: Path, cli: Cli) -> None:
    (tmp_path / "mine.toml").write_text(PLATOON, encoding="utf-8")
    run = ("run", tmp_path / "mine.toml", "--bus", "inprocess", "--samples", 5, "--no-fault", "-q", "--set", "detector.observers.0.search.trials=5")
    for text in ("x = [", DESIGNED[:1000], DESIGNED.replace("gamma", "gama"), "\x00"):
        (tmp_path / "mine.design.toml").write_text(text, encoding="utf-8")
        refused(cli(*run), BAD, "mine.design.toml")
    for text in ("version = 1\n", "version = 99\n"):  # of another version: its numbers are not today's, and are found again
        (tmp_path / "mine.design.toml").write_text(text, encoding="utf-8")
        assert cli(*run).status == DONE


# ---- options ----

RUN = ("run", "platoon", "--bus", "inprocess", "--samples", 30, "--no-fault", "-q")
OPTIONS: list[tuple[tuple[object, ...], str]] = [
    (("run", "platon"), "platoon"),
    (("run", "nowhere/x.toml"), "no such file"),
    (("run", ROOT), "no such file"),
    ((*RUN, "--scenario", "nap"), "rest"),
    ((*RUN, "--speed", "fast"), "--speed"),
    ((*RUN, "--speed", "0"), "--speed"),
    ((*RUN, "--speed", "-1"), "--speed"),
    ((*RUN, "--speed", "nan"), "--speed"),
    ((*RUN, "--seed", "-1"), "--seed"),
    ((*RUN, "--seed", "one"), "--seed"),
    ((*RUN, "--seed", "99999999999999999999999"), "--seed"),
    ((*RUN, "--samples", "0"), "--samples"),
    ((*RUN, "--samples", "-5"), "--samples"),
    ((*RUN, "--samples", "many"), "--samples"),
    ((*RUN, "--set", "sample_time_s"), "KEY=VALUE"),
    ((*RUN, "--set", "=3"), "KEY=VALUE"),
    ((*RUN, "--set", "groups.nobody.trigger.silence=1"), "nobody"),
    ((*RUN, "--set", "groups.measurement.trigger.silense=1"), "did you mean"),
    ((*RUN, "--set", "name.first=1"), "name"),
    ((*RUN, "--set", "groups.measurement.trigger.silence=[1"), "silence"),
    ((*RUN, "--set", "plant=3"), "plant"),
    ((*RUN, "--set", "groups=3"), "groups"),
    ((*RUN, "--real", "f16"), "f16"),
    ((*RUN, "--expect", "nothing"), "nothing"),
    ((*RUN, "--no-such-option"), "--no-such-option"),
    (("fly", "platoon"), "fly"),
    ((), "COMMAND"),
    (("campaign", "platoon", "--runs", "0"), "--runs"),
    (("campaign", "platoon", "--runs", "-3"), "--runs"),
    (("campaign", "platoon", "--runs", "x"), "--runs"),
    (("campaign", "platoon", "--loss", "1.5"), "--loss"),
    (("campaign", "platoon", "--loss", "nan"), "--loss"),
    (("campaign", "platoon", "--workers", "0"), "--workers"),
    (("campaign", "platoon", "--seed", "-1", "--runs", "2"), "--seed"),
    (("replay", "platoon"), "--csv"),
    (("replay", "platoon", "--csv", "nowhere.csv"), "nowhere.csv"),
    (("detect", "platoon"), "--log"),
    (("detect", "platoon", "--log", "nowhere.log"), "nowhere.log"),
    (("report", "nowhere"), "nowhere"),
    (("report", ROOT / "tests"), "run.json"),
]


@pytest.mark.parametrize(("arguments", "word"), OPTIONS, ids=[" ".join(map(str, a)) for a, _ in OPTIONS])
def test_a_bad_option_is_refused_in_one_line(cli: Cli, arguments: tuple[object, ...], word: str) -> None:
    refused(cli(*arguments), BAD, word)


def test_an_out_folder_that_is_a_file_is_refused(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="ascii")
    refused(cli(*RUN, "--out", tmp_path / "file"), BAD, "file")
    refused(cli("campaign", "platoon", "--runs", 1, "--samples", 5, "--no-fault", "-q", "--out", tmp_path / "file"), BAD, "file")
    refused(cli("design", "platoon", "-q", "--out", tmp_path / "file"), BAD, "file")


FAULTS = [
    ("controller2", "NAME:KIND"), ("controller2:bias", "NAME:KIND"), ("controller2:bias:1.0", "NAME:KIND"), ("controller2:bias@10", "needs a size"),
    ("controller2:bias:x@10", "needs a size"), ("controller2:bias:nan@10", "needs a size"), ("controller2:bias:inf@10", "needs a size"),
    ("controller2:drit:1@10", "drift"), ("controller2:freeze:1@10", "no size"), ("controller9:bias:1@10", "controller1"), ("controller2:bias:1@-3", "NAME:KIND"),
    ("controller2:bias:1@10..10", "not after"), ("controller2:bias:1@10..5", "not after"), ("controller2:bias:1@30", "starts at sample 30"),
    ("controller2:bias:1@1.5", "NAME:KIND"), (":bias:1@10", "NAME:KIND"), ("", "NAME:KIND"), ("controller2:bias:1@99999999999999999999", "starts at"),
]  # fmt: skip


@pytest.mark.parametrize(("spec", "word"), FAULTS)
def test_a_wrong_fault_is_refused_with_what_would_do(cli: Cli, spec: str, word: str) -> None:
    refused(cli("run", "platoon", "--bus", "inprocess", "--samples", 30, "-q", "--fault", spec), BAD, "fault" if "controller9" not in spec else "neither", word)


def test_more_faults_than_the_emulator_holds_are_refused(cli: Cli) -> None:
    many = [x for i in range(33) for x in ("--fault", f"gap12_m:bias:0.1@{i}")]
    refused(cli("run", "platoon", "--bus", "inprocess", "--samples", 30, "-q", *many), BAD, "32")
    refused(cli("campaign", "platoon", "--runs", 1, "--samples", 30, "-q", *many), BAD, "32")


def test_a_fault_far_ahead_ends_where_it_says(cli: Cli) -> None:
    assert cli("run", "platoon", "--bus", "inprocess", "--samples", 30, "-q", "--fault", "gap12_m:bias:0.1@3..99999999999999").status == DONE
    huge = cli("run", "platoon", "--bus", "inprocess", "--samples", 30, "-q", "--fault", "gap12_m:bias:0.1@3..99999999999999999999")
    assert huge.status in (DONE, BAD)
    assert "Traceback" not in huge.err


@pytest.mark.parametrize("bus", ["nonsuch0", "vcan99"])
def test_a_bus_that_does_not_exist_is_status_3(cli: Cli, bus: str) -> None:
    text = refused(cli("run", "platoon", "--bus", bus, "--no-fault", "-q"), NO_BUS, bus)
    assert "ip link add" in text or "this kernel has no CAN" in text
    refused(cli("run", "platoon", "-i", "socketcan", "-c", bus, "--no-fault", "-q"), NO_BUS, bus)
    refused(cli("detect", "platoon", "-i", "socketcan", "-c", bus, "-q"), NO_BUS, bus)
    refused(cli("plant", "platoon", "-i", "socketcan", "-c", bus, "-q"), NO_BUS, bus)


def test_an_interface_that_python_can_does_not_know_is_status_3(cli: Cli) -> None:
    result = cli("detect", "platoon", "-i", "telegraph", "-c", "0", "-q")
    refused(result, result.status, "telegraph")
    assert result.status in (BAD, NO_BUS)


def test_expectations_that_are_not_met_are_status_1(cli: Cli) -> None:
    base = ("run", "platoon", "--bus", "inprocess", "-q")
    refused(cli(*base, "--samples", 60, "--no-fault", "--expect", "detect"), FAILED, "no fault")
    refused(cli(*base, "--samples", 60, "--fault", "controller2:bias:0.001@10", "--expect", "detect"), FAILED, "controller2:bias:0.001@10")
    refused(cli(*base, "--samples", 60, "--fault", "controller2:bias:3@10", "--expect", "quiet"), FAILED, "alarm")
    assert cli(*base, "--samples", 60, "--fault", "controller2:bias:3@10", "--expect", "detect").status == DONE
    assert cli(*base, "--samples", 60, "--no-fault", "--expect", "quiet").status == DONE
    few = ("campaign", "platoon", "--runs", 3, "--samples", 60, "--workers", 1, "-q")
    refused(cli(*few, "--no-fault", "--expect", "detect"), FAILED, "expected")
    refused(cli(*few, "--fault", "controller2:bias:3@10", "--expect", "quiet"), FAILED, "expected")


# ---- recordings and logs ----

NAMES = ("gap12_m", "gap23_m", "speed1_mps", "control1_mps2", "control2_mps2", "control3_mps2")


def recording(rows: int = 12) -> list[list[str]]:
    return [["time_s", *NAMES], *[[f"{k * 0.1:.3f}", *["0.0"] * 6] for k in range(rows)]]


def changed(row: int, column: int, text: str) -> list[list[str]]:
    table = recording()
    table[row][column] = text
    return table


CSVS: list[tuple[str, Any, str]] = [
    ("gap", changed(5, 2, ""), "rec.csv:6"),
    ("nan", changed(5, 2, "nan"), "gap23_m"),
    ("infinite", changed(5, 2, "inf"), "gap23_m"),
    ("text", changed(5, 2, "fast"), "'fast'"),
    ("no column", [r[:-1] for r in recording()], "control3_mps2"),
    ("misspelt", [["time_s", "gap12", *NAMES[1:]], *recording()[1:]], "gap12_m"),
    ("twice", [[*r, r[1]] for r in recording()], "twice"),
    ("uneven time", changed(5, 0, "0.95"), "rec.csv:6"),
    ("time goes back", changed(5, 0, "0.2"), "rec.csv:6"),
    ("a row is missing", recording()[:5] + recording()[6:], "rec.csv:6"),
    ("time is text", changed(5, 0, "noon"), "time_s"),
    ("short row", [*recording()[:5], ["0.4", "1.0"], *recording()[6:]], "rec.csv:6"),
    ("no rows", recording()[:1], "no rows"),
    ("empty", [], "empty"),
]


@pytest.mark.parametrize(("table", "word"), [(t, w) for _, t, w in CSVS], ids=[n for n, _, _ in CSVS])
def test_a_broken_recording_is_refused_with_its_place(cli: Cli, tmp_path: Path, table: list[list[str]], word: str) -> None:
    path = tmp_path / "rec.csv"
    path.write_text("".join(",".join(r) + "\n" for r in table), encoding="utf-8")
    refused(cli("replay", "platoon", "--csv", path, "--bus", "inprocess", "-q"), BAD, "rec.csv", word)


def test_a_good_recording_is_replayed(cli: Cli, tmp_path: Path) -> None:
    path = tmp_path / "rec.csv"
    path.write_text("".join(",".join(r) + "\n" for r in recording()), encoding="utf-8")
    assert cli("replay", "platoon", "--csv", path, "--bus", "inprocess", "-q", "--expect", "quiet").status == DONE
    refused(cli("replay", "platoon", "--csv", path, "--bus", "inprocess", "-q", "--seed", -1), BAD, "--seed")
    refused(cli("replay", "platoon", "--csv", tmp_path, "--bus", "inprocess", "-q"), BAD, str(tmp_path))


def test_a_binary_file_is_no_recording_and_no_log(cli: Cli, tmp_path: Path) -> None:
    path = tmp_path / "x.bin"
    path.write_bytes(bytes(range(256)) * 4)
    refused(cli("replay", "platoon", "--csv", path, "--bus", "inprocess", "-q"), BAD, "x.bin")
    refused(cli("detect", "platoon", "--log", path, "-q"), BAD, "x.bin")
    path.write_bytes(b"\xff\xfe\x00")
    refused(cli("run", path.rename(tmp_path / "x.toml"), "--bus", "inprocess", "-q"), BAD, "x.toml")


GARBAGE = [
    "hello", "(1.0) vcan0 110", "1.0 vcan0 110#00", "(1.0) vcan0 11#00", "(1.0) vcan0 110#0", "(1.0) vcan0 110#0G", "(1.0) vcan0 110##", "(1.0) vcan0 110#" + "00" * 9,
    "(1.0) vcan0 110##1" + "00" * 65, "(1.0) vcan0 110##1" + "00" * 300, "(x) vcan0 110#00",
]  # fmt: skip


@pytest.mark.parametrize("text", GARBAGE, ids=[g[:30] for g in GARBAGE])
def test_a_garbage_line_in_a_log_is_refused_with_its_number(cli: Cli, tmp_path: Path, text: str) -> None:
    path = tmp_path / "x.log"
    path.write_text(f"(0.5) vcan0 120#00\n{text}\n", encoding="utf-8")
    refused(cli("detect", "platoon", "--log", path, "-q"), BAD, "x.log:2")


def test_a_log_of_every_kind_of_foreign_frame_is_read_and_raises_no_alarm(cli: Cli, tmp_path: Path) -> None:
    path = tmp_path / "x.log"
    lines = ["110#", "110#R", "00000110#0011223344556677", "110##10011223344556677", "20000040#0000000000000000", "7FF#00", "FFFFFFFF#00", "120#0111223344556677", "FFF#00"]
    path.write_text("".join(f"({i}.0) vcan0 {x}\n" for i, x in enumerate(lines)), encoding="ascii")
    result = cli("detect", "platoon", "--log", path, "--json", "-q", "--expect", "quiet")
    assert result.status == DONE
    assert result.json["samples"] == 0


# ---- anything at all ----

anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda x: st.lists(x, max_size=3) | st.dictionaries(st.text(max_size=5), x, max_size=3),
    max_leaves=5,
)


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    found = [path] if path else []
    if isinstance(value, dict):
        found += [p for k, v in value.items() for p in places(v, (*path, k))]
    if isinstance(value, list):
        found += [p for i, v in enumerate(value) for p in places(v, (*path, i))]
    return found


PLACES = places(tomllib.loads(PLATOON))


@settings(max_examples=400)
@given(st.sampled_from(PLACES), anything)
def test_no_value_anywhere_in_a_model_does_anything_but_pass_or_be_refused(path: tuple[Any, ...], value: Any) -> None:
    changed_model = copy.deepcopy(tomllib.loads(PLATOON))
    at(changed_model, path[:-1])[path[-1]] = value
    try:
        parse_model(changed_model, Path("mine.toml"))
    except InputError as error:
        assert len(str(error).splitlines()) == 1


@pytest.mark.parametrize("key", ["\n", "\r", "\x1b[2J", "\u2028", "a\nb"])
def test_a_key_of_control_characters_is_quoted_in_one_line(key: str) -> None:
    changed_model = copy.deepcopy(tomllib.loads(PLATOON))
    changed_model["bus"] = {key: None}
    with pytest.raises(InputError) as caught:
        parse_model(changed_model, Path("mine.toml"))
    assert str(caught.value).isprintable()


@settings(max_examples=200)
@given(st.text(max_size=60))
def test_no_text_does_anything_as_a_fault_or_override_but_pass_or_be_refused(text: str) -> None:
    for parse in (parse_fault, parse_override):
        try:
            parse(text)
        except InputError as error:
            assert len(str(error).splitlines()) == 1
    try:
        load_model("platoon", dict([parse_override(f"{text}=1")]))
    except InputError:
        pass


# ---- frames ----

OK, E_NUMERIC, E_FORMAT, E_ID, E_CRC, E_REPEATED, E_STAMP, E_BUSY, E_STATE = 1, -4, -5, -6, -7, -8, -9, -11, -15
EXTENDED, REMOTE, FD, BRS, ERROR = 1, 2, 4, 8, 16


class Line:
    """Plant, senders and one node; frames of sample k before the node sees them."""

    def __init__(self, models: Models) -> None:
        ready = models.platoon("manoeuvres")
        self.plant = Plant(ready.native, ready.design, ready.reference, [], SEED)
        self.sender, self.node, self.k = Sender(ready.native), Node(ready.native, REST), 0

    def frames(self) -> tuple[Frame | None, Frame]:
        reading = self.plant.read()
        measured, closing = self.sender.step(0, self.k, reading), self.sender.step(1, self.k, reading)
        assert closing is not None
        self.plant.move()
        self.k += 1
        return measured, closing

    def until_measured(self) -> tuple[Frame, Frame]:
        """Go on, everything received, up to the next sample with a measurement frame."""
        while True:
            measured, closing = self.frames()
            if measured is not None:
                return measured, closing
            assert self.node.receive(closing) == OK
            self.node.step()


def flipped(frame: Frame, bit: int) -> Frame:
    data = bytearray(frame.data)
    data[bit // 8] ^= 1 << bit % 8
    return Frame(frame.id, frame.flags, bytes(data))


@pytest.mark.parametrize("group", [0, 1])
def test_no_frame_with_one_wrong_bit_is_taken(models: Models, group: int) -> None:
    """Whichever of the 64 bits, early in the run and late; each is counted, and no alarm follows from it."""
    line = Line(models)
    for bit in range(64):
        pair = line.until_measured()
        before = line.node.health()["crc"]
        assert line.node.receive(flipped(pair[group], bit)) == E_CRC, bit
        assert line.node.health()["crc"] == before + 1
        # The sender has spoken; at the receiver the frame is lost: the next samples live on slews.
        if group == 0:
            assert line.node.receive(pair[1]) == OK
        else:
            assert line.node.receive(pair[0]) == OK
            assert line.node.receive(pair[1]) == OK
        verdict = line.node.step()
        assert verdict is not None
        assert verdict.plant != "confirmed"
        for _ in range(3):
            for frame in line.frames():
                if frame is not None:
                    assert line.node.receive(frame) in (OK, E_STAMP, E_STATE)
            verdict = line.node.step()
            assert verdict is not None
            assert verdict.plant != "confirmed"


@pytest.mark.parametrize("group", [0, 1])
@pytest.mark.parametrize("bits", [2, 3])
def test_no_frame_with_two_or_three_wrong_bits_is_taken(models: Models, group: int, bits: int) -> None:
    line = Line(models)
    pair = line.until_measured()
    for first in range(64):
        for second in range(first + 1, 64):
            third = () if bits == 2 else ((first * 7 + second * 13) % 64,)
            if third and third[0] in (first, second):
                continue
            frame = flipped(flipped(pair[group], first), second)
            for bit in third:
                frame = flipped(frame, bit)
            assert line.node.receive(frame) == E_CRC


KINDS = [
    *[(f"{n} bytes", 0, n, E_FORMAT, "format") for n in range(8)],
    *[(f"FD, {n} bytes", FD | BRS, n, E_FORMAT, "format") for n in (0, 2, 8, 12, 16, 64)],
    ("FD without BRS", FD, 8, E_FORMAT, "format"),
    ("remote", REMOTE, 0, E_FORMAT, "format"),
    ("remote of 8", REMOTE, 8, E_FORMAT, "format"),
    ("error report", ERROR, 8, E_FORMAT, "format"),
    ("extended twin", EXTENDED, 8, E_ID, "unknown"),
    ("extended remote", EXTENDED | REMOTE, 0, E_ID, "unknown"),
]


@pytest.mark.parametrize("group", [0, 1])
@pytest.mark.parametrize(("flags", "length", "status", "counter"), [k[1:] for k in KINDS], ids=[k[0] for k in KINDS])
def test_no_frame_of_another_kind_or_length_is_taken(models: Models, group: int, flags: int, length: int, status: int, counter: str) -> None:
    line = Line(models)
    pair = line.until_measured()
    twin = Frame(pair[group].id, flags, (pair[group].data + bytes(64))[:length])
    before = line.node.health()
    assert line.node.receive(twin) == status
    after = line.node.health()
    assert {n: after[n] - before[n] for n in after if after[n] != before[n]} == {counter: 1}
    assert line.node.step() is None, "a refused closing frame must not close the sample"
    for frame in pair:
        assert line.node.receive(frame) == OK
    verdict = line.node.step()
    assert verdict is not None
    assert verdict.plant in ("starting", "none")
    assert not verdict.refused


def test_a_frame_of_eight_bytes_as_sent_is_taken(models: Models) -> None:
    line = Line(models)
    for frame in line.until_measured():
        assert (frame.flags, len(frame.data)) == (0, 8)
        assert line.node.receive(frame) == OK


def test_a_repeated_frame_is_refused_once_and_counted(models: Models) -> None:
    line = Line(models)
    measured, closing = line.until_measured()
    assert line.node.receive(measured) == OK
    assert line.node.receive(measured) == E_REPEATED
    assert line.node.health()["repeated"] == 1
    assert line.node.receive(closing) == OK
    assert line.node.receive(measured) == E_BUSY
    verdict = line.node.step()
    assert verdict is not None
    assert verdict.bus == ("good", "good")
    assert line.node.receive(closing) == E_REPEATED


def test_a_measurement_of_another_sample_is_refused_as_early_or_late(models: Models) -> None:
    line = Line(models)
    first = line.until_measured()
    assert line.node.receive(first[1]) == OK  # closes the sample; its measurement comes too late
    line.node.step()
    assert line.node.receive(first[0]) == E_STAMP
    assert line.node.health()["late"] == 1


@settings(max_examples=300)
@given(st.integers(0, 0x1FFFFFFF) | st.sampled_from([0x110, 0x120, 0x130, 0x131]), st.integers(0, 255), st.binary(max_size=64))
def test_no_arbitrary_frame_is_taken_or_raises_an_alarm(models: Models, number: int, flags: int, data: bytes) -> None:
    line = Line(models)
    before = line.node.health()["good"]
    status = line.node.receive(Frame(number, flags, data))
    assert status in (E_ID, E_FORMAT, E_CRC) or (status == OK and flags & ~BRS == 0 and len(data) == 8)
    if status != OK:
        assert line.node.health()["good"] == before
        for frame in line.frames():
            assert frame is not None
            assert line.node.receive(frame) in (OK, E_STAMP)
        verdict = line.node.step()
        assert verdict is not None
        assert verdict.plant != "confirmed"


def test_the_status_numbers_of_this_file_are_those_of_the_library() -> None:
    lib = library("f32").lib
    assert (lib.HG_OK, lib.HG_E_NUMERIC, lib.HG_E_FORMAT, lib.HG_E_ID, lib.HG_E_CRC) == (OK, E_NUMERIC, E_FORMAT, E_ID, E_CRC)
    assert (lib.HG_E_REPEATED, lib.HG_E_STAMP, lib.HG_E_BUSY, lib.HG_E_STATE) == (E_REPEATED, E_STAMP, E_BUSY, E_STATE)
