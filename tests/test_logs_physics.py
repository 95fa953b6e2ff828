"""Roles of channels by mechanics: how a force, position, velocity, reference, clock and counter are recognised."""

from pathlib import Path

import log_files
import numpy as np
import pytest

import friso
from friso.errors import LogError
from friso.identification.logs.checks import clipped_share
from friso.identification.logs.roles import Mapping, from_options
from friso.identification.readings.common import digit_of
from friso.identification.sources import read_all, read_usable

STEP = 1e-3
LEVELS = (0, 12, 0, -12, 0, 18, 0, -18, 0, 25)


def pushed(force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] and velocity [m/s] of 3 kg with 5 N of Coulomb and 10 N s/m of viscous friction."""
    velocity, position, parts = np.zeros(len(force)), np.zeros(len(force)), 10
    speed = place = 0.0
    for k, push in enumerate(force):
        position[k], velocity[k] = place, speed
        for _ in range(parts):
            free = speed + STEP / parts * (push - 10 * speed) / 3
            speed = np.sign(free) * max(abs(free) - STEP / parts * 5 / 3, 0.0)
            place += STEP / parts * speed
    return position, velocity


def steps() -> dict[str, np.ndarray]:
    """A step test: time, force in steps, position and velocity with noise."""
    rng = np.random.default_rng(1)
    force = np.repeat(LEVELS, 600).astype(float)
    position, velocity = pushed(force)
    noise = [rng.normal(0, 0.02, len(force)), rng.normal(0, 4e-3, len(force))]
    time = STEP * np.arange(len(force))
    return {"time": time, "force": force + noise[0], "position": position, "velocity": velocity + noise[1]}


def servo(sign: float = 1.0) -> dict[str, np.ndarray]:
    """Moves on a reference, which the position follows late: time that jitters, reference, position and force."""
    rng = np.random.default_rng(2)
    time = STEP * np.arange(5000)
    reference = sum(
        way * np.clip((time - start) / 0.6, 0, 1) ** 2 * (3 - 2 * np.clip((time - start) / 0.6, 0, 1))
        for start, way in ((0.2, 0.1), (1.2, -0.2), (2.2, 0.3), (3.4, -0.15))
    )
    position, speed, force = np.zeros(len(time)), 0.0, np.zeros(len(time))
    place = 0.0
    for k in range(len(time)):
        position[k] = place
        force[k] = 8000 * (reference[k] - place) - 200 * speed
        for _ in range(10):
            free = speed + STEP / 10 * (force[k] - 10 * speed) / 3
            speed = np.sign(free) * max(abs(free) - STEP / 10 * 5 / 3, 0.0)
            place += STEP / 10 * speed
    jitter = time + rng.uniform(-1e-4, 1e-4, len(time))
    position += rng.normal(0, 1e-5, len(time))
    return {"time": jitter, "reference": reference, "position": position, "force": sign * force}


def options(path: Path) -> tuple[str, ...]:
    """The options that the first message about a log offers."""
    with pytest.raises(LogError) as caught:
        friso.identify(path, folder=path.parent)
    return getattr(caught.value, "options", ())


def written(folder: Path, names: list[str], *columns: np.ndarray) -> Path:
    return log_files.write_text(folder / f"{len([*folder.iterdir()])}.csv", names, columns)


@pytest.mark.slow
def test_force_and_velocity_without_a_unit(tmp_path: Path) -> None:
    """The one of two columns that is the derivative of nothing is no position; the copied line reads the log."""
    log = steps()
    path = written(tmp_path, ["t", "u", "v"], log["time"], log["force"], log["velocity"])
    assert {*options(path)} == {"--map velocity=v", "--map force=u", "--unit t=s", "--unit v=m/s", "--unit u=N"}
    said = from_options(["velocity=v", "force=u"], ["t=s", "v=m/s", "u=N"])
    (file,) = read_all([path], said, tmp_path)
    assert file.kind == "moves"
    assert np.ptp(file.source["position"] - log["position"]) < 0.01  # pyright: ignore[reportIndexIssue]
    against = written(tmp_path, ["t", "u", "v"], log["time"], -log["force"], log["velocity"])
    assert '--scale force="-1 N/N"' in options(against)


@pytest.mark.slow
def test_a_ramp_of_whole_numbers_counts(tmp_path: Path) -> None:
    log = steps()
    count = np.arange(len(log["time"]))
    path = written(tmp_path, ["n", "y", "u"], count, 1e3 * log["velocity"], log["force"])
    assert {"--map velocity=y", "--map force=u", "--unit y=mm/s", '--dt "NUMBER ms"'} <= {*options(path)}
    with pytest.raises(LogError, match='"n" counts samples'):
        friso.identify(path, folder=tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (2, 3, 1, 0), (3, 2, 0, 1)])
def test_no_role_follows_from_the_place_of_a_column(order: tuple[int, ...], tmp_path: Path) -> None:
    """A time that jitters is no position, and the column that leads is the reference."""
    columns = [*servo().values()]
    path = log_files.write_text(tmp_path / "a.txt", [], [columns[place] for place in order], " ")
    names = [f"column {1 + order.index(place)}" for place in range(4)]
    offered = " ".join(options(path))
    assert f'--map position="{names[2]}"' in offered
    assert f'--map force="{names[3]}"' in offered
    assert f'--map time="{names[0]}"' in offered
    assert f'"{names[1]}" goes ahead of "{names[2]}"' in str(friso.logs(path).result[0].gaps[0])


@pytest.mark.slow
def test_rpm_and_amperes(tmp_path: Path) -> None:
    """A reference speed is not taken for a position, and all open questions are asked at once."""
    log = steps()
    wanted, rpm = np.repeat(np.array(LEVELS) / 25, 600) * 600, 300 * log["velocity"]
    path = written(tmp_path, ["time", "rpm_ref", "rpm", "current"], log["time"], wanted, rpm, log["force"] / 35)
    assert {*options(path)} == {"--unit time=s", "--axis rotary", "--unit rpm=rpm", "--unit current=A"}
    (file,) = read_all([path], from_options([], ["time=s", "rpm=rpm", "current=A"], axis="rotary"), tmp_path)
    assert file.source["velocity"].max() == pytest.approx(np.pi / 30 * rpm.max())  # pyright: ignore


@pytest.mark.slow
def test_a_position_comes_before_its_own_derivative(tmp_path: Path) -> None:
    """The velocity explains the force better, but the position holds the micrometres in which bristles bend."""
    log = servo()
    velocity = np.gradient(log["position"], log["time"])
    path = written(tmp_path, ["t", "x", "v", "u"], log["time"], log["position"], velocity, log["force"])
    assert {"--map position=x", "--map force=u"} <= {*options(path)}


@pytest.mark.slow
def test_names_of_torques_tell_a_rotary_axis_where_the_motion_has_no_unit(tmp_path: Path) -> None:
    log = steps()
    columns = [log["time"], log["velocity"], log["force"]]
    offered = options(written(tmp_path, ["time", "speed", "torque"], *columns))
    assert {*offered} == {"--unit time=s", "--axis rotary", "--unit speed=rad/s", '--unit torque="N*m"'}
    assert "--axis rotary" not in options(written(tmp_path, ["time", "speed [mm/s]", "torque"], *columns))


@pytest.mark.slow
def test_logs_with_the_same_channels_are_asked_once(tmp_path: Path) -> None:
    """A log that hardly moves would have the force for the position: most decide."""
    log, names = steps(), ["t", "u", "v"]
    still = np.random.default_rng(1).normal(0, 1e-3, len(log["time"]))
    paths = [
        written(tmp_path, names, log["time"], log["force"], moving)
        for moving in (still, log["velocity"], log["velocity"])
    ]
    with pytest.raises(LogError) as caught:
        friso.identify(paths, folder=tmp_path)
    assert {*getattr(caught.value, "options", ())} == {
        "--map velocity=v",
        "--map force=u",
        "--unit t=s",
        "--unit v=m/s",
        "--unit u=N",
    }
    assert "and 2 more with the same channels" in caught.value.origin


def test_a_kept_role_that_is_wrong_is_mentioned(tmp_path: Path) -> None:
    log = steps()
    columns = [log["time"], log["force"], log["velocity"]]
    path = written(tmp_path, ["time [s]", "force [N]", "velocity [m/s]"], *columns)
    for channel in ("force", "elsewhere"):
        path.with_name("0.csv.friso.toml").write_text(f'[roles]\nposition = "{channel}"\n', "utf-8")
        with pytest.raises(LogError, match=f"as kept in 0.csv.friso.toml: position is {channel}"):
            friso.identify(path, folder=tmp_path)


def test_a_command_that_switches_is_not_clipped_and_in_round_numbers_not_coarse() -> None:
    """A dozen levels, all multiples of 0.1 N, each held for half a second."""
    switched = np.repeat([0.0, 9.0, 0.0, 9.0], 500)
    assert clipped_share(switched) == 0
    assert digit_of(switched) == 0
    wave = 9 * np.sin(np.linspace(0, 20, 2000))
    assert clipped_share(np.clip(wave, -6, 6)) > 0.3
    assert digit_of(np.round(wave)) == pytest.approx(1.0)
    levels = np.array([1.2, -0.7, 2.0, 0.3, -1.9, 1.1, -0.4, 0.8, -1.5, 1.7, 0.5, -1.1])
    assert digit_of(np.repeat(levels, 500)) == 0
    slow = np.round(2 * np.sin(np.linspace(0, 6, 6000)), 1)
    assert digit_of(slow) == pytest.approx(0.1)
    encoder = np.round(30 * np.clip(np.sin(np.linspace(0, 6, 3000)), 0, 0.8) ** 2)
    assert digit_of(encoder) == pytest.approx(1.0)


def test_two_readings_are_asked(tmp_path: Path) -> None:
    """Two forces that explain the motion about as well: neither is offered, and both are named."""
    log = servo()
    twice = log["force"] * 2 + np.random.default_rng(3).normal(0, 0.1, len(log["force"]))
    other = twice + 7 * np.sign(np.gradient(log["position"]))
    path = written(tmp_path, ["time [s]", "pos [m]", "a", "b"], log["time"], log["position"], log["force"], other)
    with pytest.raises(LogError) as caught:
        friso.identify(path, folder=tmp_path)
    assert not any("--map force" in option for option in getattr(caught.value, "options", ()))
    assert "--map force=b or --map force=a" in str(caught.value)


@pytest.mark.slow
def test_a_bad_stamp_costs_its_file_alone(tmp_path: Path) -> None:
    log, paths = servo(), []
    for number in range(3):
        time = STEP * np.arange(5000)
        time[2500] = 1.0 if number == 1 else time[2500]
        paths.append(written(tmp_path, ["time [s]", "pos [m]", "force [N]"], time, log["position"], log["force"]))
    files, wrong = read_usable(paths, Mapping(), tmp_path)
    assert [file.path for file in files] == [paths[0], paths[2]]
    assert [error.origin for error in wrong] == [str(paths[1])]


def test_what_was_kept_and_is_said_otherwise_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, ["time [s]", "a [m]", "b [m]", "force [N]"], *servo().values())
    (tmp_path / "0.csv.friso.toml").write_text('[roles]\nposition = "a"\n')
    (file,) = read_all([path], from_options(["position=b", "reference=a"]), tmp_path)
    assert "in place of position is a, as kept" in file.reused
    (file,) = read_all([path], from_options(["reference=a", "position=b"]), tmp_path)
    assert file.mapping.roles == {"reference": "a", "position": "b"}
