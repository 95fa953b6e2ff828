"""Mistakes of logs that are said, with the way out: a wrong heading, lost parts, rounded stamps, words in LVM."""

import re
from pathlib import Path

import log_files
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_files import motion, write_text
from refusals import refused

import friso
from friso.errors import LogError
from friso.identification.logs.assemble import read_log
from friso.identification.logs.checks import repeated_stamps
from friso.identification.logs.read import read_table
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


def moved(**changes: np.ndarray) -> list[np.ndarray]:
    """Columns of a motion, in s, mm and N, some of them changed."""
    columns = motion(4000)
    columns["position"] = 1e3 * columns["position"]
    return [{**columns, **changes}[name] for name in ("time", "position", "force")]


HEADING = ["time (s)", "position (mm)", "force (N)"]


def placed(values: np.ndarray, number: float, *places: slice) -> np.ndarray:
    changed = values.copy()
    for place in places:
        changed[place] = number
    return changed


@pytest.mark.parametrize(
    ("role", "number", "places", "lost"),
    [
        ("force", -9999.0, [slice(100, 110), slice(2000, 2003)], 13),
        ("position", -999.25, [slice(900, 901)], 1),
        ("position", 0.0, [slice(1462, 1467)], 5),
        ("force", 150.0, [slice(100, 110)], 0),
        ("position", -99.0, [slice(0, 3900)], 0),
    ],
    ids=["a sentinel", "a single one", "a dropout to 0", "a round number within", "hardly anything else"],
)
def test_numbers_that_stand_for_no_value_count_as_lost(
    tmp_path: Path, role: str, number: float, places: list[slice], lost: int
) -> None:
    columns = motion(4000)
    scale = 1e3 if role == "position" else 1.0
    file = write_text(tmp_path / "log.csv", HEADING, moved(**{role: placed(scale * columns[role], number, *places)}))
    table = read_table(file)
    (channel,) = (one for one in table.channels if one.name == role)
    assert np.count_nonzero(np.isnan(channel.values)) == lost
    assert len(table.warnings) == (lost > 0)


def test_a_row_of_units_that_contradicts_a_heading_asks(tmp_path: Path) -> None:
    """Either may be wrong by a factor of a thousand."""
    file = write_text(tmp_path / "log.csv", HEADING, moved(), units=["s", "m", "N"])
    with pytest.raises(LogError, match=re.escape("--unit")):
        read_log(file)
    read = read_log(file, from_options(units=["position (mm)=mm"]))
    assert np.ptp(read.signals["position"]) == pytest.approx(np.ptp(motion(4000)["position"]))


@pytest.mark.parametrize(
    ("heading", "unit", "size"),
    [("force (10 mN)", "", 1e-2), ("force", "2.5e-3 N", 2.5e-3), ("force (25 Hz)", "N", 1.0), ("ActTrq", "N", 1.0)],
)
def test_a_unit_may_have_a_number(tmp_path: Path, heading: str, unit: str, size: float) -> None:
    file = write_text(tmp_path / "log.csv", [*HEADING[:2], heading], moved())
    read = read_log(file, from_options(units=[f"{heading}={unit}"] if unit else []))
    assert np.ptp(read.signals["force"]) == pytest.approx(size * np.ptp(motion(4000)["force"]))


def test_infinity_as_a_sign_is_no_value(tmp_path: Path) -> None:
    file = write_text(tmp_path / "log.csv", HEADING, moved())
    lines = file.read_text(encoding="utf-8").splitlines()
    lines[77] = ",".join([*lines[77].split(",")[:2], "-∞"])
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert "1 of 4000 samples lost" in " ".join(read_log(file).warnings)
