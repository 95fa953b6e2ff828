"""Mistakes of logs that are said, with the way out: a wrong heading, lost parts, rounded stamps, words in LVM."""

import re
from pathlib import Path

import log_files
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

import friso
from friso.errors import LogError
from friso.identification.logs.assemble import read_log
from friso.identification.logs.checks import repeated_stamps
from friso.identification.logs.roles import from_options

M = log_files.motion()


def write(path: Path, time: np.ndarray, kept: np.ndarray, unit: str = "s") -> Path:
    columns = np.stack([time, M["position"], M["force"]], axis=1)[kept]
    np.savetxt(path, columns, "%.9g", ",", header=f"t [{unit}],position [m],force [N]", comments="")
    return path


def test_a_heading_in_milliseconds_above_seconds_is_asked_about(tmp_path: Path) -> None:
    every = np.ones(len(M["time"]), bool)
    wrong = write(tmp_path / "wrong.csv", M["time"], every, "ms")
    with pytest.raises(LogError) as asked:
        read_log(wrong)
    name = asked.value.example.removeprefix("--unit ").removesuffix("=s")
    assert read_log(wrong, from_options(units=[f"{name}=s"])).sample_time == pytest.approx(1e-3)
    assert read_log(wrong, from_options(units=[f"{name}=ms"])).sample_time == pytest.approx(1e-6)
    assert read_log(write(tmp_path / "right.csv", 1e3 * M["time"], every, "ms")).sample_time == pytest.approx(1e-3)


@pytest.mark.parametrize(("lost", "said"), [(11, True), (150, True), (2, False)])
def test_rows_lost_in_the_middle_are_told_before_anything_is_identified(tmp_path: Path, lost: int, said: bool) -> None:
    """Up to three samples are interpolated, which is told otherwise."""
    kept = np.ones(len(M["time"]), bool)
    kept[150 : 150 + lost] = False
    content = friso.logs(write(tmp_path / "a.csv", M["time"], kept)).result[0]
    lines = [line for line in content.warnings if "missing" in line]
    assert bool(lines) == said
    if said:
        assert float(re.findall(r"time: (\S+) s of", lines[0])[0]) == pytest.approx(lost * 1e-3, rel=0.01)
    else:
        assert any(f"{lost} of" in line for line in content.warnings)


@settings(max_examples=40, deadline=None)
@given(st.floats(2e-4, 0.02), st.sampled_from([1.0, 0.1, 0.5]), st.floats(0, 1))
def test_stamps_rounded_to_seconds_show_the_step_between_samples(step: float, digit: float, begin: float) -> None:
    count = round(9.3 * digit / step)
    if digit / step < 10:
        return
    stamps = np.floor((begin * digit + step * np.arange(count)) / digit) * digit
    with pytest.raises(LogError) as error:
        repeated_stamps("position", stamps, np.arange(count) * 1.0)
    (proposed,) = re.findall(r'--dt "(\S+) ms"', error.value.example)
    assert float(proposed) == pytest.approx(1e3 * step, rel=1.2 * step / digit)


@pytest.mark.parametrize("cell", ["1_0", "x", "0x1F", "1e5_0"])
def test_a_word_among_the_numbers_of_lvm_is_refused(tmp_path: Path, cell: str) -> None:
    path = log_files.write_lvm(tmp_path / "a.lvm", {"position": ("mm", M["position"]), "force": ("N", M["force"])})
    lines = path.read_text().splitlines()
    cells = lines[-50].split("\t")
    lines[-50] = "\t".join([cells[0], cell, *cells[2:]])
    path.write_text("\n".join(lines) + "\n")
    with refused("log"):
        read_log(path)


def test_comments_in_lvm_are_no_numbers(tmp_path: Path) -> None:
    path = log_files.write_lvm(tmp_path / "a.lvm", {"position": ("mm", M["position"]), "force": ("N", M["force"])})
    lines = path.read_text().splitlines()
    lines[-50] += "\tset the gain to 1_0"
    path.write_text("\n".join(lines) + "\n")
    assert read_log(path)["position"].size == len(M["time"])
