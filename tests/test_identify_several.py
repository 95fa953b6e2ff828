"""Several logs: one event each, a controller of their own, and predictions refused before anything is fitted."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusals import refused
from test_identify_experiments import DT, FLAT, LUGRE, ramps, travels

import friso
from friso.identification.experiments.break_away import static_from_ramps
from friso.identification.kind import as_set_up
from friso.identification.kinds import KINDS
from friso.identification.logs import read
from friso.identification.logs.gaps import GapsError
from friso.identification.logs.log import Log, join_logs
from friso.identification.logs.roles import Mapping
from friso.identification.method import check_predictions, identify
from friso.identification.readings.common import record
from friso.identification.readings.course import Course
from friso.identification.readings.friction_velocity import friction_velocity
from friso.identification.sources import read_all
from friso.stage import Stage


def piece(log: Log, part: slice, name: str) -> Log:
    """One segment of a log as a log of its own."""
    signals = {role: values[part] for role, values in log.signals.items()}
    return record(name, log.sample_time, **signals)


@pytest.fixture(scope="module")
def whole() -> Log:
    return ramps(LUGRE, [1.0, 1.0, 5.0, 5.0], 1.0, np.random.default_rng(3))


def test_ramps_of_one_break_away_each_are_one_experiment(whole: Log) -> None:
    """A log that says enough alone stays alone."""
    single = [piece(whole, part, f"ramp {i}") for i, part in enumerate(whole.segments)]
    assert not any(static_from_ramps(log).static.determined for log in single)
    result = identify([(log, "break-away") for log in single])
    (experiment,) = result.experiments
    (estimate,) = result.estimates
    assert len(experiment.result.ramps.times) == 4
    assert estimate.value == pytest.approx(static_from_ramps(whole).static.value, rel=1e-3)
    assert estimate.holds(LUGRE[0])
    assert [len(group) for group in KINDS["break-away"].groups([whole, whole, single[0]])] == [1, 1, 1]


def claims(kind: str, *courses: Course) -> bool:
    """Whether logs are of a kind: one by itself, or several together."""
    if len(courses) == 1:
        return bool(KINDS[kind].claims(courses[0]))
    return bool(KINDS[kind].claims_together(courses))


def test_one_speed_each_is_recognised_together_and_several_alone() -> None:
    """A log with one speed, looked at alone, looks like one of moves."""
    speeds = (0.02, 0.05, 0.1)

    def course(*speeds: float) -> Course:
        log = travels([*speeds], FLAT, np.random.default_rng(1))
        return Course(replace(log, signals={role: log[role] for role in ("position", "force")}))

    courses, several = [course(speed) for speed in speeds], course(*speeds)
    assert claims("constant-speed", *courses)
    assert claims("constant-speed", *(Course(replace(one.log, units={"force": "A"})) for one in courses))
    assert not claims("constant-speed", *courses[:2])
    assert (claims("constant-speed", courses[0]), claims("moves", courses[0])) == (False, True)
    assert (claims("constant-speed", several), claims("moves", several)) == (True, False)


def test_runs_that_stick_and_slip_are_of_the_same_experiment_and_moves_are_not() -> None:
    time, random = DT * np.arange(4000), np.random.default_rng(1)

    def course(position: np.ndarray) -> Course:
        force = 2 + 1e-3 * random.standard_normal(time.size)
        return Course(record("run", DT, position=position + 1e-8 * random.standard_normal(time.size), force=force))

    steady, together = [course(speed * time) for speed in (0.02, 0.05, 0.1)], KINDS["constant-speed"].claims_together
    slipping = 1e-3 * np.floor(time / 0.4)
    assert claims("constant-speed", *steady)
    assert claims("constant-speed", *steady, course(slipping + 1e-3 * np.clip(time % 0.4 / 0.05, 0, 1)))
    assert not claims("constant-speed", *steady, course(0.05 * np.sin(2 * np.pi * time)))
    assert not together([course(slipping)])


def test_a_body_within_its_bristles_goes_at_no_constant_speed() -> None:
    """A force that rises and falls moves it as a spring does, at constant speeds."""
    time, random = DT * np.arange(12000), np.random.default_rng(1)
    force = np.concatenate([size * np.abs(4 * (time[:4000] / 2 % 1) - 2) - size for size in (1.0, 2.0, 3.0)])
    log = record("loops", DT, position=force / 1e6 + 1e-9 * random.standard_normal(time.size), force=force)
    assert not claims("constant-speed", Course(log))
    assert not friction_velocity(log).both.coulomb.determined


def test_logs_of_one_speed_each_are_one_curve_of_friction() -> None:
    friction = np.array([1.5, 1.0, 1e-3, 1e5, 316.2, 4.0])
    speeds = (0.02, 0.05, 0.1)
    single = [
        replace(travels([speed], FLAT, np.random.default_rng(i), friction=friction), name=f"{speed:g} m/s")
        for i, speed in enumerate(speeds)
    ]
    assert not any(friction_velocity(log).both.coulomb.determined for log in single)
    (group,) = KINDS["constant-speed"].groups(single)
    curve = friction_velocity(group[0], 1.0)
    assert len(curve.velocities) == 6
    assert curve.both.coulomb.holds(1.0)
    assert curve.both.viscous.holds(4.0)


def test_logs_that_are_not_alike_are_not_joined(whole: Log) -> None:
    """Logs with another sample time or from another setup of the stage stay apart; others join with gaps."""
    one, two, three = (piece(whole, part, f"{i}") for i, part in enumerate(whole.segments[:3]))
    groups = KINDS["break-away"].groups([one, two, replace(three, setup={"joint.stroke": "8 mm"})])
    assert [group[0].name for group in groups] == ["0, 1", "2"]
    slow = replace(two, sample_time=2 * DT, time=2 * two.time)
    assert len(KINDS["break-away"].groups([one, slow])) == 2
    log = record("a", 0.1, position=np.arange(5.0))
    both = join_logs([log, replace(log, name="b")])
    assert both.segments == (slice(0, 5), slice(5, 10))
    assert np.diff(both.time).max() > 2 * 0.1
    assert both["position"] == pytest.approx(np.tile(np.arange(5.0), 2))


def test_stops_within_a_ramp_are_no_break_aways() -> None:
    """A body that moves off at 1.5 N, is stopped, and goes on at a higher force of the same ramp."""
    time = np.arange(0, 6.0, DT)
    push = 0.5 * time
    place = np.zeros_like(time)
    for begin, end in ((3.0, 3.4), (4.0, 4.4), (5.0, 5.4)):
        moving = (time >= begin) & (time < end)
        place += np.cumsum(moving * np.sin(np.pi * (time - begin) / (end - begin)) ** 2) * 5e-3 * DT
    rng = np.random.default_rng(1)
    log = record("ramp", DT, position=place + 1e-8 * rng.standard_normal(len(time)), force=push)
    result = static_from_ramps(log)
    assert result.ramps.forces == pytest.approx([1.5], rel=0.05)


@pytest.fixture
def axis() -> Stage:
    return friso.load("examples/emps_axis.toml")


def test_a_controller_of_its_own(axis: Stage) -> None:
    """Another gain takes its place among the others; a controller of another form replaces the stage's whole."""
    log = record("moves", 1e-3, position=np.arange(100.0), force=np.arange(100.0))
    gain = as_set_up(axis, replace(log, setup={"controller.kp": "1e6 N*s/m"}))
    assert gain["controller.kp"] == 1e6
    assert gain["controller.kv"] == axis.flat()["controller.kv"]
    keys = {"kind": "pid", "crossover": "20 Hz", "alpha": "0.1", "beta": "2"}
    other = as_set_up(axis, replace(log, setup={f"controller.{key}": text for key, text in keys.items()}))
    assert other["controller.crossover"] == 20
    assert "controller.kp" not in other
    with refused("controller.kpp"):
        as_set_up(axis, replace(log, setup={"controller.kpp": "1e6 N*s/m"}))


def test_predictions_that_cannot_be_made_are_refused_before_the_fit(axis: Stage) -> None:
    signals = {"position": np.arange(100.0), "force": np.arange(100.0)}
    bare, moved = record("bare", 1e-3, **signals), record("moved", 1e-3, reference=np.arange(100.0), **signals)
    check_predictions([(moved, "moves")], [moved], axis)
    check_predictions([(bare, "moves"), (moved, "moves")], [moved], axis)
    wrong = replace(moved, setup={"controller.kpp": "1 N/m"})
    for logs, predicted, stage, key in (
        ([(moved, "moves")], moved, None, "--predict"),
        ([(moved, "moves")], bare, axis, "reference"),
        ([(bare, "moves")], moved, axis, "--predict"),
        ([(moved, "break-away")], moved, axis, "--predict"),
        ([(moved, "moves")], wrong, axis, "controller.kpp"),
    ):
        with refused(key):
            check_predictions(logs, [predicted], stage)


def test_each_file_is_parsed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many options name its channels, and whether or not questions stay open."""
    parsed: Counter[Path] = Counter()

    def counted(form: read.LogFormat) -> read.LogFormat:
        return replace(form, read=lambda path: parsed.update([path]) or form.read(path))

    monkeypatch.setattr(read, "FORMATS", {name: counted(read.FORMATS[name]) for name in read.FORMATS})
    paths = [tmp_path / f"{name}.csv" for name in "abc"]
    rows = "".join(f"{i / 1000},{np.sin(i / 50):.6f},{np.cos(i / 50):.6f}\n" for i in range(1000))
    for path in paths:
        path.write_text(f"t [s],ActPos,Drive\n{rows}")
    mapping = Mapping({"position": "ActPos", "force": "Drive"}, units={"ActPos": "mm"})
    with pytest.raises(GapsError):  # the unit of the force is open
        read_all(paths, mapping, tmp_path)
    assert parsed == dict.fromkeys(paths, 1)
    parsed.clear()
    read_all(paths, replace(mapping, units={"ActPos": "mm", "Drive": "N"}, experiment="moves"), tmp_path)
    assert parsed == dict.fromkeys(paths, 1)
