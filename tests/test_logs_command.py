"""`friso logs` as a user runs it: what it shows of files of any kind, without identifying anything."""

import errno
import json
from pathlib import Path
from typing import Any

import log_files
import numpy as np
import pandas as pd
import pytest
from inside import friso_inside

import friso

TIME = 1e-3 * np.arange(1200)
FORCE = 30 * np.sin(2 * np.pi * 3 * TIME) * np.exp(-2 * TIME)  # nothing repeats: a log of moves
M = {"time": TIME, "force": FORCE, "position": np.cumsum(np.cumsum(FORCE / 20)) * 1e-6}


def content(path: Path, **options: Any) -> Any:
    """What a log holds."""
    return friso.logs(path, **options).result[0]


def command(path: Path, **options: Any) -> str:
    """The command that identifies from a log, or nothing."""
    return " ".join(friso.logs(path, **options).next_steps([])).replace(str(path), "LOG")


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """A log without units whose force is called by a letter."""
    return log_files.write_text(tmp_path / "bare.csv", ["t", "x", "u"], [M["time"], M["position"] * 1e3, M["force"]])


def test_channels_ranges_rates_and_roles(tmp_path: Path) -> None:
    names = ["time [s]", "position [mm]", "force [N]", "temp"]
    force = np.where(np.arange(1200) == 5, np.nan, M["force"])
    path = log_files.write_text(tmp_path / "a.csv", names, [M["time"], M["position"] * 1e3, force, np.full(1200, 21.5)])
    held = content(path)
    by_name = {channel.name: channel for channel in held.channels}
    assert held.kind == "moves"
    assert not held.gaps
    assert by_name["time"].role == "time"
    assert by_name["position"].role == "position"
    assert by_name["position"].range == pytest.approx((1e3 * M["position"].min(), 1e3 * M["position"].max()))
    assert by_name["position"].sample_rate == pytest.approx(1000)
    assert by_name["force"].missing == 1
    assert by_name["temp"].role == ""
    assert command(path) == "friso identify LOG"


def test_the_course_of_a_channel(tmp_path: Path) -> None:
    ramp = np.arange(1200.0)
    path = log_files.write_text(tmp_path / "a.csv", ["time [s]", "position [mm]"], [M["time"], ramp])
    assert content(path).channels[1].course() == pytest.approx(50 * np.arange(24) + 24.5)


@pytest.mark.slow
def test_what_is_open_and_the_command_for_it(bare: Path) -> None:
    assert {gap.key for gap in content(bare).gaps} == {"position", "force", "time"}
    proposed = command(bare)
    for option in ("--map position=x", "--map force=u", "--unit t=s", "--unit x=mm", "--unit u=N"):
        assert option in proposed
    options = {"map": {"position": "x", "force": "u"}, "unit": {"t": "s", "x": "mm", "u": "N"}}
    assert content(bare, **options).kind == "moves"
    path = log_files.write_text(bare, ["q", "x [mm]", "f"], [M["time"], M["position"], M["force"]])
    said = command(path, map={"force": "f"}, unit={"f": "N"}, dt="1 ms")
    assert said == 'friso identify LOG --map force=f --unit f=N --dt "0.001 s"'


def test_a_log_that_no_option_completes_has_no_command(tmp_path: Path) -> None:
    """A force alone, of which no option makes a position. Beside a velocity nothing is open."""
    time = ["time [s]"]
    alone = log_files.write_text(tmp_path / "a.csv", [*time, "force [N]"], [M["time"], M["force"]])
    (gap,) = content(alone).gaps
    assert gap.expected.endswith("export the log with position")
    assert command(alone) == ""
    names = [*time, "v_ist [m/s]", "F_ist [N]"]
    speed = log_files.write_text(tmp_path / "b.csv", names, [M["time"], np.gradient(M["position"], 1e-3), M["force"]])
    assert not content(speed).gaps


def test_a_multisine_in_volts_needs_no_newtons(tmp_path: Path) -> None:
    """The kind is recognised from the channels that are proposed, and no scale is asked for."""
    rng, count = np.random.default_rng(1), 500
    lines = np.zeros(count // 2 + 1, dtype=complex)
    lines[1:40] = np.exp(2j * np.pi * rng.random(39))
    volts = np.tile(np.fft.irfft(lines, count), 8)
    place = np.tile(np.fft.irfft(lines / np.maximum(np.arange(lines.size), 1) ** 2, count), 8)
    path = log_files.write_text(
        tmp_path / "a.csv", ["time [s]", "pos [mm]", "input [V]"], [1e-3 * np.arange(8 * count), place, volts]
    )
    assert [gap.example for gap in content(path).gaps] == ["--map force=input"]
    assert content(path, map={"force": "input"}).kind == "frequency"


def test_a_frequency_response(tmp_path: Path) -> None:
    columns = [np.arange(1.0, 101.0), np.arange(1.0, 101.0) ** -2, np.full(100, -180.0)]
    path = log_files.write_text(tmp_path / "frf.csv", ["f [Hz]", "mag [m/N]", "phase [deg]"], columns)
    held = content(path)
    assert (held.kind, held.response.frequency.size) == ("frequency", 100)


@pytest.mark.slow
def test_the_command(bare: Path, tmp_path: Path) -> None:
    done = friso_inside(tmp_path, "logs", "bare.csv", "--out", "out")
    assert done.returncode == 0
    assert "▁" in done.stdout
    assert {file.name for file in (tmp_path / "out").iterdir()} >= {"logs.html", "logs_1.png"}
    for text in (done.stdout, (tmp_path / "out" / "logs.html").read_text("utf-8")):
        assert "--map force=u" in text
    assert not (tmp_path / "bare.csv.friso.toml").exists()
    document = json.loads(friso_inside(tmp_path, "logs", "bare.csv", "--json").stdout)
    (log,) = document["logs"]
    assert [channel["name"] for channel in log["channels"]] == ["t", "x", "u"]
    assert {gap["about"] for gap in log["open"]} == {"position", "force", "time"}
    nothing = np.full(1200, np.nan)
    log_files.write_text(bare, ["t", "x", "u", "load"], [M["time"], M["position"], M["force"], nothing])
    assert "left out: column 4 (load)" in friso_inside(tmp_path, "logs", "bare.csv").stdout


@pytest.mark.parametrize("columns", [{}, {"x": np.full(1200, np.nan)}, {"x": np.full(1200, np.nan), "u": M["time"]}])
def test_a_file_is_drawn_as_far_as_it_holds_something(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = log_files.write_text(tmp_path / "a.csv", ["t", *columns], [M["time"], *columns.values()])
    done = friso_inside(tmp_path, "logs", path.name, "--out", "out")
    assert done.returncode == 0
    assert (tmp_path / "out" / "logs.html").exists()
    assert (tmp_path / "out" / "logs_1.png").exists() == ("u" in columns)


@pytest.mark.parametrize("full", [False, True])
def test_one_bad_file_does_not_hide_the_others(
    bare: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, full: bool
) -> None:
    """The other files are also shown if the disk is full."""

    def no_space(*_: object) -> list[Path]:
        raise OSError(errno.ENOSPC, "No space left on device")

    if full:
        monkeypatch.setattr("friso.interface.output_folder.OutputFolder.write", no_space)
    (tmp_path / "empty.csv").write_text("")
    done = friso_inside(tmp_path, "logs", "empty.csv", "bare.csv", "--out", "out")
    assert done.returncode == 2
    assert "bare.csv" in done.stdout
    assert "empty.csv" in done.stderr
    assert ("No space left" in done.stderr) == full


def test_the_only_channel_of_times_that_rises_is_the_clock(tmp_path: Path) -> None:
    """Or one that is known by its name, in German as well."""
    path, values = tmp_path / "a.csv", [M["position"] * 1e3, M["force"]]
    for name, sign, kind in (("Sekunde", 1, "moves"), ("Uhrzeit", 1, "moves"), ("Sekunde", -1, "")):
        names = [f"{name} [ms]", "pos [mm]", "force [N]"]
        held = content(log_files.write_text(path, names, [sign * 1e3 * M["time"], *values]))
        assert held.kind == kind
        assert (held.channels[0].role == "time") == (sign > 0)


@pytest.mark.slow
def test_examples_are_channels_that_may_have_the_role(tmp_path: Path) -> None:
    """A reference is not suggested as a force, rpm not as a position, a counter not as a clock.

    No sample time is invented.
    """

    def proposed(names: list[str], *values: np.ndarray) -> str:
        return command(log_files.write_text(tmp_path / "a.csv", names, [*values], "," if names else " "))

    noise = 1e-6 * np.random.default_rng(1).standard_normal(M["time"].size)
    plain, time = [M["position"], M["position"] + noise, M["force"]], M["time"]
    counted = proposed([], np.arange(time.size), *plain)
    assert all(text in counted for text in ('position="column 3"', 'force="column 4"', '--dt "NUMBER ms"'))
    assert '--map time="column 1"' in proposed([], time, *plain)
    rotary = proposed(["t [s]", "n_soll [rpm]", "n_ist [rpm]", "M [Nm]"], time, *plain)
    assert rotary == "friso identify LOG --axis rotary"
    names = ["Time", "header.stamp.secs", "header.stamp.nsecs", "position_0", "effort_0"]
    stamps = [1e9 + time, 1e9 + np.floor(time), 1e9 * (time % 1)]
    assert "header" not in proposed(names, *stamps, M["position"], M["force"])


def test_the_command_asks_for_the_constant_of_a_motor(tmp_path: Path) -> None:
    file = tmp_path / "amperes.csv"
    time = np.arange(400) * 1e-3
    columns = {"Time [s]": time, "SetPos [mm]": np.sin(9 * time), "ActPos [mm]": np.sin(9 * time), "Current [A]": time}
    pd.DataFrame(columns).to_csv(file, index=False)
    assert "--scale force=" in command(file)
    assert command(file, scale={"force": "35 N/A"}).count("--scale") == 1


def test_of_a_large_text_a_sample_is_read_and_its_rows_are_estimated(tmp_path: Path) -> None:
    time = 1e-3 * np.arange(120_000)
    force = np.sin(time) + np.sin(2.3 * time)
    path = tmp_path / "large.csv"
    frame = pd.DataFrame({"time [s]": time, "position [mm]": np.cumsum(np.cumsum(force)) * 1e-6, "force [N]": force})
    frame.to_csv(path, index=False)
    held = content(path)
    position = held.channels[1]
    assert held.sampled
    assert position.values.size < time.size / 2
    assert position.count == pytest.approx(time.size, rel=0.05)
    assert position.duration == pytest.approx(120, rel=0.05)
    assert held.kind == "moves"
    whole = content(log_files.write_text(tmp_path / "small.csv", [*frame], [frame[n][:5000] for n in frame]))
    assert not whole.sampled
    assert whole.channels[1].count == 5000
