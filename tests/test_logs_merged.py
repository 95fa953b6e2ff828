"""Two files of one run, by two clocks: made twins of known offset and ratio, and those that cannot be aligned."""

from pathlib import Path

import log_files
import numpy as np
import pytest

from friso.errors import InputError
from friso.identification.logs.assemble import read_log
from friso.identification.logs.log import Channel, ChannelTable
from friso.identification.logs.merge import aligned, merged, motions_of
from friso.identification.logs.read import read_file
from friso.identification.logs.roles import Mapping

FINE = np.arange(-10.0, 45.0, 1e-3)


def run(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Moves of random length and size between rests: position and velocity over `FINE`, and a force of 2 kg."""
    velocity, i = np.zeros(FINE.size), 0
    while i < FINE.size:
        long, rest = int(rng.uniform(200, 900)), int(rng.uniform(50, 600))
        part = velocity[i : i + long]
        part[:] = rng.normal() * np.sin(np.pi * np.arange(part.size) / long) ** 2
        i += long + rest
    position = np.concatenate([[0.0], np.cumsum((velocity[1:] + velocity[:-1]) / 2)]) * 1e-3
    return {"position": position, "velocity": velocity, "force": 2 * np.gradient(velocity, 1e-3)}


def seen(time: np.ndarray, values: np.ndarray, rng: np.random.Generator, noise: float) -> np.ndarray:
    """What an instrument shows at instants of the first clock, with noise relative to the signal's spread."""
    exact = np.interp(time, FINE, values)
    return exact + noise * np.std(exact) * rng.normal(size=time.size)


@pytest.mark.slow
@pytest.mark.parametrize("kinds", [("position", "position"), ("position", "velocity"), ("velocity", "position")])
@pytest.mark.parametrize("noise", [1e-4, 1e-2])
def test_intervals_hold_over_twins_drawn_at_random(kinds: tuple[str, str], noise: float) -> None:
    rng, right = np.random.default_rng(11), []
    first_time, second_time = np.arange(0, 30, 2e-3), np.arange(0, 24, 3.3e-3)
    for _ in range(12):
        begins, ratio = rng.uniform(-3, 5), 1 + rng.uniform(-2e-3, 2e-3)
        signals = run(rng)
        values = [
            seen(time, signals[kind], rng, noise)
            for kind, time in zip(kinds, (first_time, begins + ratio * second_time), strict=True)
        ]
        one, other = (
            motions_of(ChannelTable((Channel("x", "", value, time, ""),)), {"x": kind})[0]
            for kind, value, time in zip(kinds, values, (first_time, second_time), strict=True)
        )
        (fit,) = aligned(one, other)
        right += [abs(fit.begins - begins) < fit.half_begins, abs(fit.ratio - ratio) < fit.half_ratio]
        assert abs(fit.begins - begins) < 4 * fit.half_begins
        assert fit.half_begins < 5e-3
    assert np.mean(right) >= 0.8  # by chance, 1 in 1000 intervals of 95 % hold less often


def files(tmp_path: Path, offset: float = 0.37, ratio: float = 1.0003) -> tuple[Path, Path]:
    """A drive's file with the position, and a DAQ's with velocity and force, whose clock is another."""
    rng, signals = np.random.default_rng(5), run(np.random.default_rng(2))
    time, later = np.arange(0, 30, 1e-3), np.arange(0, 28, 0.8e-3)
    drive = [time, 1e3 * seen(time, signals["position"], rng, 1e-4)]
    daq = [later, *(seen(offset + ratio * later, signals[name], rng, 1e-3) for name in ("velocity", "force"))]
    return (
        log_files.write_text(tmp_path / "drive.csv", ["time [s]", "position [mm]"], drive),
        log_files.write_text(tmp_path / "daq.csv", ["t [s]", "velocity [m/s]", "force [N]"], daq),
    )


def test_the_force_of_one_file_moves_what_the_other_shows(tmp_path: Path) -> None:
    drive, daq = (read_file(path) for path in files(tmp_path))
    log = read_log(merged(drive, daq, Mapping()), needed=("position", "force"))
    assert log.read[0].startswith("daq.csv begins at 0.37")
    inner = slice(500, -500)
    speed = np.gradient(log["position"], log.sample_time)
    assert np.corrcoef(speed[inner], log["velocity"][inner])[0, 1] > 0.99
    assert np.corrcoef(log["force"][inner], np.gradient(log["velocity"])[inner])[0, 1] > 0.9


def cut(path: Path, first: float, last: float) -> Path:
    """Keep the rows of a file between two of its instants."""
    head, *rows = path.read_text().splitlines()
    path.write_text("\n".join([head, *(row for row in rows if first <= float(row.split(",")[0]) < last)]) + "\n")
    return path


def test_without_overlap_or_motion_or_with_a_motion_that_repeats_it_is_refused(tmp_path: Path) -> None:
    drive, daq = files(tmp_path)
    with pytest.raises(InputError, match="agree nowhere"):
        merged(read_file(cut(drive, 0, 10)), read_file(cut(daq, 15, 28)), Mapping())
    still = log_files.write_text(tmp_path / "still.csv", ["time [s]", "force [N]"], [FINE[:900], np.sin(FINE[:900])])
    with pytest.raises(InputError, match=r"no position or velocity that changes in still\.csv"):
        merged(read_file(drive), read_file(still), Mapping())
    time = np.arange(0, 20, 1e-3)
    sines = [
        log_files.write_text(tmp_path / f"{i}.csv", ["time [s]", "position [mm]"], [time, np.sin(6 * (time + 0.3 * i))])
        for i in range(2)
    ]
    with pytest.raises(InputError, match="repeats"):
        merged(read_file(sines[0]), read_file(sines[1]), Mapping())
