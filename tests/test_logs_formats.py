"""Readers of logs: each format returns what was written and reports how it was read."""

import itertools
import os
import re
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import log_files
import numpy as np
import psutil
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from patience import LIMIT, grows_with_the_square
from refusals import refused
from scipy.io import savemat
from systems import posix

from friso.errors import InputError, LogError
from friso.identification.logs import read
from friso.identification.logs import read as reading
from friso.identification.logs.assemble import read_log
from friso.identification.logs.log import Channel, ChannelTable
from friso.identification.logs.read import file_format, is_frequency_response, read_frequency_response, read_table
from friso.identification.logs.roles import Mapping
from friso.identification.logs.settings import LogSettings
from friso.platform.system import LIMITS_MEMORY

M = log_files.motion()
HEADING = ["time [ms]", "position [mm]", "force [N]"]
COLUMNS = [M["time"] * 1e3, M["position"] * 1e3, M["force"]]


def channel(table: ChannelTable, name: str) -> Channel:
    return next(item for item in table.channels if item.name == name)


def check_motion(table: ChannelTable, unit: str = "mm", scale: float = 1e3) -> None:
    position = channel(table, "position")
    assert position.unit == unit
    assert position.time is not None
    assert position.values == pytest.approx(M["position"] * scale, rel=1e-12, abs=1e-15)
    assert position.time == pytest.approx(M["time"], rel=1e-12, abs=1e-12)


@pytest.mark.cases(first=3)
@pytest.mark.parametrize(
    ("delimiter", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", ","), (" ", "."), (" ", ",")]
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
def test_text_in_any_writing(tmp_path: Path, delimiter: str, decimal: str, encoding: str) -> None:
    note = "Prüfstand 3\nµ = 1\n"
    path = log_files.write_text(tmp_path / "a.csv", HEADING, COLUMNS, delimiter, decimal, encoding, note)
    table = read_table(path)
    check_motion(table)
    assert channel(table, "force").unit == "N"
    sign = "comma" if decimal == "," else "point"
    assert f"decimal {sign}, encoding {encoding}, 4 lines before" in table.read[0]


@pytest.mark.cases(first=3)
@pytest.mark.parametrize(
    ("heading", "units"),
    [
        (("time (ms)", "position (mm)", "force (N)"), ()),
        (('"time [ms]"', '"position [mm]"', '"force [N]"'), ()),
        (("# time [ms]", "position [mm]", "force [N]"), ()),
        (("time", "position", "force"), ("ms", "mm", "N")),
        (("time", "position", "force"), ("[ms]", "[mm]", "[N]")),
        (("time", "position", "force"), ("(ms)", "(mm)", "(N)")),
    ],
)
def test_units_in_the_heading_or_in_a_row_of_their_own(
    tmp_path: Path, heading: tuple[str, ...], units: tuple[str, ...]
) -> None:
    check_motion(read_table(log_files.write_text(tmp_path / "a.txt", heading, COLUMNS, ";", units=units)))


TIMED = "\n".join(
    f"{1e3 * t:.9g};{x:.9g};{f:.9g}" for t, x, f in zip(M["time"], M["position"], M["force"], strict=True)
)
SECONDS = "\n".join(f"{t:.9g},{x:.9g},{f:.9g}" for t, x, f in zip(M["time"], M["position"], M["force"], strict=True))
ROWS = "\n".join(f"{x:.9g};{f:.9g}" for x, f in zip(M["position"], M["force"], strict=True))

COMMAS = ROWS.replace(";", ",")


@pytest.mark.cases(first=10)
@pytest.mark.parametrize(
    "text",
    [
        f"t_ms;pos_mm;force;\n{TIMED}",
        f"t_ms;pos_mm;force\n{TIMED.replace(chr(10), ';' + chr(10), 1)}",
        f"t_ms;pos_mm;force\n{TIMED.replace(chr(10), ';' + chr(10))};",
        f"t_ms;pos_mm;force\n{TIMED}\n\x1a",
        f"t_ms;pos_mm;force\n{TIMED}\x1a\n",
        f"Sample interval: 1 ms\nUnits;mm;N\npos;force\n{ROWS}",
        f"Sample interval;0.001;s;\nUnits;mm;N\npos;force\n{ROWS}",
        f"# dt = 1e-3 s\n# units: mm, N\npos;force\n{ROWS}",
        f"Sampling rate [Hz];1000\npos unit;mm\nforce unit;N\n\npos;force\n{ROWS}",
        f"Model,MSO24,,\nHorizontal Units,s,,\nVertical Units,mm,N,\nTIME,CH1,CH2\n{SECONDS}",
        f"Sample Period:,1 ms\npos [mm],force [N]\n{COMMAS}",
        f"Sampling rate:,1,kHz,\npos [mm],force [N]\n{COMMAS}",
        f"Device:,A3,Interval:,1,msec,Samples:,{len(M['time'])}\npos [mm],force [N]\n{COMMAS}",
        f'"Interval","1,0 ms"\npos [mm],force [N]\n{COMMAS}',
        f"Sample Period:;1,0;ms\npos [mm];force [N]\n{ROWS.replace('.', ',')}",
        f"Sampling rate:|1 kHz\npos [mm]|force [N]\n{ROWS.replace(';', '|')}",
        f"Sampling rate:\t1\tkHz\npos [mm]\tforce [N]\n{ROWS.replace(';', chr(9))}",
    ],
)
def test_texts_as_people_have_them(tmp_path: Path, text: str) -> None:
    """Rows end in delimiters, the file ends in DOS's mark, and text stands above the table or within names."""
    path = tmp_path / "a.csv"
    path.write_bytes(text.encode())
    position, force = read_table(path).channels[-2:]
    assert position.unit == "mm"
    assert position.values == pytest.approx(M["position"], rel=1e-8)
    assert force.values == pytest.approx(M["force"], rel=1e-8)
    assert position.time == pytest.approx(M["time"], abs=1e-9)
    assert force.time == pytest.approx(M["time"], abs=1e-9)


TRIGGERED = "\n".join(
    f"{'Trigger Point,1.25e+03' if i == 0 else ','},,{1e-3 * i - 1:.9f},{0.1 * i:.5f}," for i in range(80)
)


@pytest.mark.parametrize(
    ("text", "channels"),
    [
        ("# units: mm, N\npos;force;state\n" + "0.5;1.5;2.5\n" * 60, ["pos", "force", "state"]),
        (TRIGGERED, ["column 4", "column 5"]),
        ("pos[1],current (filtered) [A],i (old)\n" + "1,2,3\n" * 20, ["pos[1]", "current (filtered) in A", "i (old)"]),
        ("Time (s) Stage Position (mm)\n" + "1  2.5\n" * 20, ["Time in s", "Stage Position in mm"]),
        ("t [s];pos;pos;pos #2;pos\n0;1;2;3;4\n1;2;3;4;5\n", ["t in s", "pos", "pos #3", "pos #2", "pos #4"]),
    ],
    ids=["fewer units", "a row with a word", "brackets", "words between spaces", "one name"],
)
def test_names_and_units_of_channels(tmp_path: Path, text: str, channels: list[str]) -> None:
    (tmp_path / "a.csv").write_text(text)
    read = [f"{item.name} in {item.unit}".removesuffix(" in ") for item in read_table(tmp_path / "a.csv").channels]
    assert read == channels


def test_numbers_of_a_scope_beside_its_names_and_units(tmp_path: Path) -> None:
    rows = "\n".join(f"{i},{0.01 * i:.3f},{-0.02 * i:.3f},," for i in range(60))
    (tmp_path / "a.csv").write_text(f"X,CH1,CH2,Start,Increment,\nSequence,Volt,mV,-1.0e+00,1.0e-03\n{rows}\n")
    table = read_table(tmp_path / "a.csv")
    assert [(channel.name, channel.unit) for channel in table.channels[1:]] == [("CH1", "Volt"), ("CH2", "mV")]
    assert table.scalars == {"Increment": 1e-3}


@pytest.mark.parametrize("texts", [["-1.234,5", "999,25", "1.000.000,0"], ["1.234", "2.345", "999,25"]])
def test_thousands_are_grouped_only_where_no_number_could_be_another(tmp_path: Path, texts: list[str]) -> None:
    rows = "\n".join(f"0,{i:03d};0,5;{text}" for i, text in enumerate(texts * 20))
    (tmp_path / "a.csv").write_text(f"t [s];y [um];x [um]\n{rows}\n")
    table = read_table(tmp_path / "a.csv")
    if "-1.234,5" in texts:
        assert channel(table, "x").values[:3] == pytest.approx([-1234.5, 999.25, 1e6])
    else:
        assert not any(1.234 in item.values for item in table.channels)


@pytest.mark.parametrize(("cell", "told_as"), [("1_a", 'such as "1_a"'), ("RUN", "left out")])
def test_a_column_that_holds_no_numbers_is_left_out(tmp_path: Path, cell: str, told_as: str) -> None:
    rows = "\n".join(f"0.{i:03d},0.5,{cell},1" for i in range(60))
    (tmp_path / "a.csv").write_text(f"t [s],x [um],state,force [N]\n{rows}\n")
    table = read_table(tmp_path / "a.csv")
    assert [c.name for c in table.channels] == ["t", "x", "force"]
    assert any(told_as in line and "state" in line for line in table.read)


def test_a_column_that_ends_early_keeps_the_only_clock(tmp_path: Path) -> None:
    rows = "\n".join(f"{1e-3 * i:.3f},{i},{i if i < 90 else 'nan'}" for i in range(100))
    (tmp_path / "a.csv").write_text(f"Time (s),Force (N),Displacement (mm)\n{rows}\n")
    assert channel(read_table(tmp_path / "a.csv"), "Displacement").time == pytest.approx(1e-3 * np.arange(90))


@pytest.mark.parametrize(
    "line", ["dt: 1", "dt: 1 ms\nfs: 500 Hz", "dt: none", "fs: 10,000 Hz", "dt:,1 ms", "dt: 1,5 ms"]
)
def test_no_interval_is_made_up(tmp_path: Path, line: str) -> None:
    """Without a unit or a number, where two lines contradict each other, or digits have two meanings, none is read."""
    path, sign = tmp_path / "a.csv", "," if line == "dt: 1,5 ms" else ";"
    path.write_text(f"{line}\npos [mm]{sign}force [N]\n{ROWS.replace(';', sign)}", encoding="utf-8")
    assert all(channel.time is None for channel in read_table(path).channels)


@pytest.mark.parametrize(("time", "unit", "step"), [("", "", 1e-3), ("t,", "", 1e-3), ("t,", "s", 2e-3)])
def test_a_unit_of_the_user_leaves_the_sample_time_of_the_file(
    tmp_path: Path, time: str, unit: str, step: float
) -> None:
    """Only a column of times whose unit the user states counts before it."""
    rows = [f"{2e-3 * i:.9g}," * bool(time) + row for i, row in enumerate(COMMAS.split("\n"))]
    (tmp_path / "a.csv").write_text("\n".join(["Sample Period:,1 ms", f"{time}pos,force [N]", *rows]))
    units = {"pos": "mm"} | ({"t": unit} if unit else {})
    assert read_log(tmp_path / "a.csv", Mapping(units=units)).sample_time == pytest.approx(step, rel=1e-9)


WHOLE = "pos_s, acc_rms, x_ref, ms, pos_in, pos_min, mm/s, on/off, [m], Damping N*s/mm, Gain A/V, test space (1)"
WITHIN = "tempo_ms ms, vel_mm_s mm/s, acc_m_s2 m/s2, torque_Nm Nm, força_N N, time_s s"
BEHIND = "enc1 (mm); x / nm; v in mm/s; w/(mm/s); Weg s/mm; y [flurbs]; omega rad/s; vel_mm/s; Stiffness N/m"
SPLIT = "enc1 mm, x nm, v mm/s, w mm/s, Weg s mm, y flurbs, omega rad/s, vel mm/s, Stiffness N/m"
"""Headings of channels: of which the unit is none, stands within the name or behind it."""


def test_units_in_or_behind_a_name(tmp_path: Path) -> None:
    """A unit within the name stays there; a stroke within a unit is not the one before a unit."""
    within = [text.rpartition(" ")[::2] for text in WITHIN.split(", ")]
    expected = [*((name, "") for name in WHOLE.split(", ")), *within]
    expected += [text.rpartition(" ")[::2] for text in SPLIT.split(", ")]
    headings = [*WHOLE.split(", "), *(name for name, _ in within), *BEHIND.split("; ")]
    path = log_files.write_text(tmp_path / "a.csv", headings, [M["position"]] * len(headings), "|")
    assert [(item.name, item.unit) for item in read_table(path).channels] == expected


def test_one_column_with_a_decimal_comma(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("pos [mm]\n" + "".join(f"0,{i}\n" for i in range(10, 30)))
    only = read_table(tmp_path / "a.txt").channels
    assert only[0].values == pytest.approx(np.arange(10, 30) / 100)


def test_one_time_column_per_channel(tmp_path: Path) -> None:
    slow = 5e-3 * np.arange(80)
    columns = [M["time"], M["position"], slow * 1e3, np.cos(slow)]
    table = read_table(
        log_files.write_text(tmp_path / "a.csv", ["t1 [s]", "x [m]", "t2 [ms]", "F [N]"], columns, ";", ",")
    )
    x, force = channel(table, "x"), channel(table, "F")
    assert x.time == pytest.approx(M["time"])
    assert force.time == pytest.approx(slow)
    assert force.values == pytest.approx(np.cos(slow))


def test_whole_numbers_first_and_decimal_commas_later(tmp_path: Path) -> None:
    lines = ["t [ms];x [mm]"] + [f"{i};0" for i in range(60_000)] + [f"{i};0,5" for i in range(60_000, 60_010)]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    assert channel(read_table(tmp_path / "a.csv"), "x").values[-1] == 0.5


@pytest.mark.parametrize(
    "stamps",
    [
        ["2026-01-31T23:59:59.998", "2026-01-31T23:59:59.999", "2026-02-01T00:00:00.000", "2026-02-01T00:00:00.001"],
        ["2026-01-31 23:59:59.998Z", "2026-01-31 23:59:59.999Z", "2026-02-01 00:00:00Z", "2026-02-01 00:00:00.001Z"],
        ["23:59:59.998", "23:59:59.999", "00:00:00.000", "00:00:00.001"],
        ["23:59:59:998", "23:59:59:999", "00:00:00:000", "00:00:00:001"],
        ["9:05:00:8", "9:05:00:9", "9:05:00:10", "9:05:00:011"],
        ["31.01.2026 23:59:59.998", "31.01.2026 23:59:59.999", "01.02.2026 00:00:00.000", "01.02.2026 00:00:00.001"],
        ["1/31/26 12:59:59.998 PM", "1/31/26 12:59:59.999 PM", "1/31/26 1:00:00.000 PM", "1/31/26 1:00:00.001 PM"],
        ["11:59:59.998 am", "11:59:59.999 am", "12:00:00.000 pm", "12:00:00.001 pm"],
    ],
)
def test_time_stamps(tmp_path: Path, stamps: list[str]) -> None:
    rows = [f"{stamp},{i}.5" for i, stamp in enumerate(stamps)]
    (tmp_path / "a.csv").write_text("\n".join(["time,pos [mm]", *rows]))
    time = channel(read_table(tmp_path / "a.csv"), "pos").time
    assert time == pytest.approx([0, 1e-3, 2e-3, 3e-3], abs=1e-9)


@pytest.mark.slow
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=3, max_size=30),
    writing=st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", ","), ("\t", "."), (" ", ".")]),
)
def test_any_numbers_come_back(tmp_path: Path, rows: list[tuple[float, ...]], writing: tuple[str, str]) -> None:
    columns = list(np.array(rows).T)
    table = read_table(log_files.write_text(tmp_path / "a.csv", ["a [m]", "b [N]", "c [V]"], columns, *writing))
    for item, expected in zip(table.channels, columns, strict=True):
        assert item.values == pytest.approx(expected, rel=1e-15, abs=0)


@pytest.mark.cases(first=4)
@pytest.mark.parametrize(
    ("delimiter", "full"), [*itertools.product(["\t", ";", ","], [True, False]), (":", True), (" ", True)]
)
def test_twincat_groups_end_at_different_rows(tmp_path: Path, delimiter: str, full: bool) -> None:
    slow = np.sin(np.arange(100) * 4e-3)
    fast = [("ActPos", "mm (Length)", M["position"] * 1e3), ("ActVelo", "", M["velocity"])]
    groups = [(1.0, fast), (4.0, [("ActTorque", "%", slow)])]
    decimal = "." if delimiter == "," else ","
    table = read_table(log_files.write_twincat(tmp_path / "a.csv", groups, delimiter, decimal, full=full))
    assert "TwinCAT" in table.read[0]
    assert [c.name for c in table.channels] == ["ActPos", "ActVelo", "ActTorque"]
    position, torque = channel(table, "ActPos"), channel(table, "ActTorque")
    assert position.values == pytest.approx(M["position"] * 1e3, rel=1e-12)
    assert position.time == pytest.approx(M["time"], abs=1e-12)
    assert torque.values == pytest.approx(slow, rel=1e-12)  # Offset 1 and ScaleFactor -1 are applied already
    assert torque.time == pytest.approx(4e-3 * np.arange(100))
    assert position.unit == ("mm" if full else "")
    assert any("ActTorque" in line and "100 samples, 0 s to 0.396 s" in line for line in table.read)


@pytest.mark.parametrize("delimiter", ["\t", " "])
def test_twincat_rows_that_have_shifted(tmp_path: Path, delimiter: str) -> None:
    """Without the empty cells of a group that has ended, those behind it would be read as its own."""
    slow, fast = np.sin(np.arange(100) * 4e-3), M["position"] * 1e3
    groups = [(4.0, [("ActTorque", "%", slow)]), (1.0, [("ActPos", "mm", fast)])]
    path = log_files.write_twincat(tmp_path / "a.csv", groups, delimiter)
    lines = path.read_text(encoding="utf-8").split("\n")
    path.write_text("\n".join(line.lstrip(delimiter) for line in lines), encoding="utf-8")
    with refused("log"):
        read_table(path)


def test_twincat_absolute_times(tmp_path: Path) -> None:
    groups = [(0.25, [("ActPos", "mm", M["position"])])]
    table = read_table(log_files.write_twincat(tmp_path / "a.csv", groups, start=132959733843760000))
    assert channel(table, "ActPos").time == pytest.approx(0.25e-3 * np.arange(400), abs=1.7e-6)  # 16 ticks of 100 ns


@pytest.mark.slow
def test_dspace_structure_with_time_and_tdms(tmp_path: Path) -> None:
    """A file is known by its content, whatever its name."""
    signals = {"position (mm)": M["position"] * 1e3, "input (V)": M["force"]}
    log_files.write_dspace(tmp_path / "a.mat", signals, M["time"]).rename(tmp_path / "a.csv")
    assert file_format(tmp_path / "a.csv") == "mat"
    check_motion(read_table(tmp_path / "a.csv"))
    signals = {"position [m]": M["position"], "force [N]": M["force"]}
    check_motion(read_table(log_files.write_structure_with_time(tmp_path / "a.mat", signals, M["time"])), "m", 1)
    pytest.importorskip("nptdms")
    check_motion(read_table(log_files.write_tdms(tmp_path / "log.bin", SIGNALS)))


def test_units_of_mat_files_stand_beside_arrays_or_in_their_names(tmp_path: Path) -> None:
    """A structure of one array and its unit is that array."""
    savemat(tmp_path / "a.mat", {"position": {"value": M["position"] * 1e3, "unit": "mm"}, "force_N": M["force"]})
    table = read_table(tmp_path / "a.mat")
    assert [(c.name, c.unit) for c in table.channels] == [("position", "mm"), ("force_N", "N")]
    savemat(tmp_path / "b.mat", {"run": {"x": M["position"], "f": M["force"], "unit": "um"}})
    assert [(c.name, c.unit) for c in read_table(tmp_path / "b.mat").channels] == [("run.x", ""), ("run.f", "")]


def test_mat_73(tmp_path: Path) -> None:
    path = log_files.write_mat73(
        tmp_path / "a.mat", {"t": M["time"], "fs": np.array(1e3)}, {"position (mm)": M["position"] * 1e3}
    )
    table = read_table(path)
    check_motion(table)
    assert table.scalars == {"fs": 1000.0}
    assert channel(table, "t").values == pytest.approx(M["time"])
    assert any("result (timeseries)" in line and "structure with time" in line for line in table.read)


def test_two_variables_with_the_same_signals_are_told_apart(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {k: {"x": M["position"] * i, "n": 3} for i, k in ((1, "run1"), (2, "run2"))})
    table = read_table(tmp_path / "a.mat")
    assert [c.name for c in table.channels] == ["run1.x", "run2.x"]
    assert table.scalars == {"run1.n": 3.0, "run2.n": 3.0}


SIGNALS = {"position": ("mm", M["position"] * 1e3), "force": ("N", M["force"])}


@pytest.mark.slow
def test_universal_files(tmp_path: Path) -> None:
    """Units come from the label, else from the data type and the file's units; times have their axis's unit."""
    pyuff = pytest.importorskip("pyuff")
    position = channel(read_table(log_files.write_uff(tmp_path / "a.unv", M["time"], SIGNALS)), "position")
    assert position.values == pytest.approx(M["position"] * 1e3, rel=1e-9, abs=1e-12)
    assert position.time == pytest.approx(M["time"], abs=1e-9)
    path = log_files.write_uff(tmp_path / "a.uff", M["time"], {"position": ("", M["position"])})
    assert channel(read_table(path), "position").unit == ""
    units = {"units_code": 5, "length": 1e3, "force": 1e3, "temp": 1.0, "temp_offset": 0.0}
    data = pyuff.UFF(str(path)).read_sets(0)
    data |= {"abscissa_axis_units_lab": "ms", "x": M["time"] * 1e3, "abscissa_inc": 1.0}
    pyuff.UFF(str(path)).write_sets([pyuff.prepare_164(**units), data], "overwrite")
    position = channel(read_table(path), "position")
    assert position.unit == "mm"
    assert position.time == pytest.approx(M["time"], abs=1e-7)


LVM_HEAD = """LabVIEW Measurement\t
Separator\tTab
X_Columns\tMulti
***End_of_Header***\t

Channels\t2\t\t\t
Y_Unit_Label\tmm\t\tN\t
***End_of_Header***\t\t\t\t
X_Value\tUntitled\tX_Value\tUntitled 1\tComment
"""


@pytest.mark.slow
def test_units_of_lvm_stand_above_their_columns(tmp_path: Path) -> None:
    """Units are also read with a time column per channel, and where a channel has no unit."""
    columns = zip(M["time"], M["position"], M["time"], M["force"], strict=True)
    text = LVM_HEAD + "".join("\t".join(map(repr, map(float, row))) + "\n" for row in columns)
    path = tmp_path / "a.lvm"
    path.write_text(text, encoding="utf-8")
    assert [(c.unit, c.values.size) for c in read_table(path).channels] == [("mm", 400), ("N", 400)]
    path.write_text(text.replace("\tmm\t\tN", "\t\t\tN"), encoding="utf-8")
    assert [c.unit for c in read_table(path).channels] == ["", "N"]


def test_lvm(tmp_path: Path) -> None:
    pytest.importorskip("lvm_read")
    table = read_table(log_files.write_lvm(tmp_path / "a.txt", SIGNALS))
    assert channel(table, "position").values == pytest.approx(M["position"] * 1e3, abs=1e-8)
    assert channel(table, "position").time == pytest.approx(M["time"], abs=1e-9)
    assert channel(table, "force").unit == "N"
    assert not [line for line in table.read if line.startswith("contradiction")]
    # the library would leave a cache file unless told not to
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    text = (tmp_path / "a.txt").read_text("utf-8")
    for said, other in (("Delta_X\t0.00", "Delta_X\t0.02"), ("Samples\t400", "Samples\t300")):
        assert said in text
        (tmp_path / "c.lvm").write_text(text.replace(said, other), "utf-8")
        assert [line for line in read_table(tmp_path / "c.lvm").read if line.startswith("contradiction")]
    empty = {name: (unit, x[:0]) for name, (unit, x) in SIGNALS.items()}
    with refused("log"):
        read_table(log_files.write_lvm(tmp_path / "b.lvm", empty))


@pytest.mark.parametrize(("library", "name"), [("pyuff", "a.uff"), ("lvm_read", "a.lvm")])
def test_a_log_with_fewer_samples_than_it_states_says_so(tmp_path: Path, library: str, name: str) -> None:
    pytest.importorskip(library)
    path = tmp_path / name
    if name == "a.uff":
        log_files.write_uff(path, M["time"], SIGNALS)
        path.write_text(re.sub("(?m)^( +[24]) +400 ", r"\1       500 ", path.read_text()))
    else:
        log_files.write_lvm(path, SIGNALS)
        path.write_text("\n".join(path.read_text().splitlines()[:-100]) + "\n")
    assert [note for note in read_table(path).read if "position ends early" in note]


def test_without_the_library_the_message_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.tdms").write_bytes(b"TDSm" + bytes(100))
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(InputError, match=r'pip install "friso\[tdms\]"'):
        read_table(tmp_path / "a.tdms")


FREQUENCY = np.linspace(1, 100, 40)
RESPONSE = 1 / (-2 * (2 * np.pi * FREQUENCY) ** 2 + 40j * FREQUENCY + 1e4)
DEGREES = np.degrees(np.angle(RESPONSE))
MOBILITY, ACCELERANCE = 2j * np.pi * FREQUENCY * RESPONSE, -((2 * np.pi * FREQUENCY) ** 2) * RESPONSE


@pytest.mark.cases(first=6)
@pytest.mark.parametrize(
    ("heading", "columns", "unit"),
    [
        (["f [Hz]", "mag [dB]", "phase [deg]"], (20 * np.log10(abs(RESPONSE)), np.degrees(np.angle(RESPONSE))), ""),
        (["f [Hz]", "magnitude [mm/N]", "phase [rad]"], (1e3 * abs(RESPONSE), np.angle(RESPONSE)), "m/N"),
        (["Frequency (Hz)", "Re [m/N]", "Im [m/N]"], (RESPONSE.real, RESPONSE.imag), "m/N"),
        (["omega [rad/s]", "real", "imag"], (RESPONSE.real, RESPONSE.imag), ""),
        (["freq_hz", "Mag (dB re 1 mm/N)", "phase [deg]"], (20 * np.log10(1e3 * abs(RESPONSE)), DEGREES), "m/N"),
        (["f [Hz]", "Mag [dB re 1e-6 m/N]", "phase [deg]"], (20 * np.log10(1e6 * abs(RESPONSE)), DEGREES), "m/N"),
        (["f [Hz]", "Re [(m/s^2)/N]", "Im [(m/s^2)/N]"], (ACCELERANCE.real, ACCELERANCE.imag), "m/N"),
        (["f [Hz]", "Re [mm/s/N]", "Im [mm/s/N]"], (MOBILITY.real * 1e3, MOBILITY.imag * 1e3), "m/N"),
        (["f [Hz]", "Mag (mm/s/A)", "phase (deg)"], (1e3 * abs(MOBILITY), DEGREES + 90), "m/A"),
        (["f [Hz]", "Mag [deg/s/Nm]", "phase [deg]"], (np.degrees(abs(MOBILITY)), DEGREES + 90), "rad/(N*m)"),
        (["f [Hz]", "Mag [g/N]", "phase [deg]"], (abs(ACCELERANCE) / 9.80665, DEGREES + 180), "m/N"),
        (["f [Hz]", "Mag dB [mm/N]", "phase [deg]"], (20 * np.log10(1e3 * abs(RESPONSE)), DEGREES), "m/N"),
        (["f [Hz]", "Re [m/N]", "Im [mm/N]"], (RESPONSE.real, 1e3 * RESPONSE.imag), "m/N"),
        (["f [Hz]", "FRF (Real)", "FRF (Imag)"], (RESPONSE.real, RESPONSE.imag), ""),
        (["f [Hz]", "Mag (re 1 N)", "Phase (re 1 N) [deg]"], (abs(RESPONSE), DEGREES), ""),
    ],
)
def test_frequency_responses_as_text(
    tmp_path: Path, heading: list[str], columns: tuple[np.ndarray, ...], unit: str
) -> None:
    axis = FREQUENCY * (2 * np.pi if "omega" in heading[0] else 1)
    path = log_files.write_text(
        tmp_path / "plant.csv", [*heading, "coherence"], [axis, *columns, 0.9 + 0 * axis], ";", ","
    )
    assert is_frequency_response(path)
    response = read_frequency_response(path)
    assert response.frequency == pytest.approx(FREQUENCY, rel=1e-12)
    assert np.allclose(response.response, RESPONSE, rtol=1e-10, atol=0)
    assert response.coherence == pytest.approx(0.9)
    assert (response.unit, response.name) == (unit, "plant")


def test_frequency_response_of_a_universal_file(tmp_path: Path) -> None:
    pytest.importorskip("pyuff")
    axis = np.linspace(0, 100, 41)
    signals = {"plant": ("mm/N", 1e3 / (1e4 - axis**2 + 1j * axis)), "coherence": ("", 0.8 + 0 * axis)}
    path = log_files.write_uff(tmp_path / "a.uff", axis, signals, 4)
    assert is_frequency_response(path)
    response = read_frequency_response(path)
    assert response.frequency == pytest.approx(axis[1:])  # the line at 0 Hz is left out
    assert np.allclose(response.response, (1 / (1e4 - axis**2 + 1j * axis))[1:], rtol=1e-9)
    assert (response.unit, response.coherence) == ("m/N", pytest.approx(0.8))
    assert not is_frequency_response(log_files.write_text(tmp_path / "a.csv", HEADING, COLUMNS))


@posix
def test_what_is_no_file_of_some_size_is_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Opening a pipe would wait for a writer, and a device may never end."""
    monkeypatch.setattr(reading, "decoded_head", lambda path: pytest.fail("read before it was refused"))
    with (tmp_path / "big.csv").open("wb") as file:
        file.truncate(10 * 2**30)
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (tmp_path, *(tmp_path / name for name in ("none.csv", "big.csv", "pipe.csv")), Path("/dev/zero")):
        with refused("log"):
            read_table(path)


@pytest.mark.slow
def test_a_matrix_is_a_channel_per_column(tmp_path: Path) -> None:
    both = np.stack([M["position"], M["force"]], axis=1)
    savemat(tmp_path / "old.mat", {"y": both, "image": np.zeros((90, 80))})
    log_files.write_mat73(tmp_path / "new.mat", {"y": both.T})  # HDF5 holds MATLAB's arrays transposed
    for name in ("old.mat", "new.mat"):
        table = read_table(tmp_path / name)
        assert [c.name for c in table.channels] == ["y(:,1)", "y(:,2)"]
        assert table.channels[1].values == pytest.approx(M["force"])
    assert any("array of 90 x 80" in line for line in read_table(tmp_path / "old.mat").read)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("way", ["link", "storage", "virtual", "link in a group", "link to a link", "reference"])
def test_values_in_another_file_are_not_read(tmp_path: Path, way: str) -> None:
    """A file may name any other one of the system as the place of its values."""
    import h5py

    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file["secret"] = M["position"]
    path = tmp_path / "a.mat"
    with h5py.File(path, "w") as file:
        file["time"] = M["time"]
        if way == "storage":
            file.create_dataset("x", (50,), "f8", external=[(str(other), 0, 400)])
        elif way == "reference":
            hidden = file.create_dataset("#refs#/a", (50,), "f8", external=[(str(other), 0, 400)])
            file.create_dataset("x", data=[hidden.ref], dtype=h5py.ref_dtype)
        elif way == "virtual":
            layout = h5py.VirtualLayout((400,), "f8")
            layout[:] = h5py.VirtualSource(str(other), "secret", (400,))
            file.create_virtual_dataset("x", layout)
        else:
            place = file.create_group("g") if "group" in way else file
            place["#x" if "link to" in way else "x"] = h5py.ExternalLink(str(other), "secret")
            if "link to" in way:
                file["x"] = h5py.SoftLink("/#x")
    with refused("log"):
        read_table(path)


def zeros_as_mat(path: Path, count: int) -> None:
    """A small MAT file that holds many zeros, compressed."""
    squeezed, block = zlib.compressobj(1), bytes(1 << 23)
    parts = [(14, 64 + 8 * count), (6, 8, 6, 0), (5, 8, count, 1), (1, 1, ord("x"), 0), (9, 8 * count)]
    out = [squeezed.compress(b"".join(struct.pack(f"<{len(part)}i", *part) for part in parts))]
    out += [squeezed.compress(block[: 8 * count - at]) for at in range(0, 8 * count, len(block))]
    data = b"".join([*out, squeezed.flush()])
    head = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + struct.pack("<H", 0x0100) + b"IM"
    path.write_bytes(head + struct.pack("<ii", 15, len(data)) + data)


@pytest.mark.slow
@pytest.mark.skipif(not LIMITS_MEMORY, reason="this system does not hold a process to an amount of memory")
def test_a_file_that_swells_is_an_error_of_its_own(tmp_path: Path) -> None:
    with LogSettings(memory_of_reading=400 << 20).in_use():
        zeros_as_mat(tmp_path / "small.mat", 1000)
        assert channel(read_table(tmp_path / "small.mat"), "x").values.shape == (1000,)
        zeros_as_mat(tmp_path / "large.mat", 50_000_000)
        with refused("log"):
            read_table(tmp_path / "large.mat")


def endless_mat(path: Path) -> None:
    """References to references, each level twice as many."""
    import h5py

    with h5py.File(path, "w") as file:
        below = file.create_dataset("#0", data=M["position"])
        for level in range(1, 60):
            below = file.create_dataset(f"#{level}", data=[below.ref, below.ref], dtype=h5py.ref_dtype)
        file.create_dataset("x", data=[below.ref], dtype=h5py.ref_dtype)


def unwritten_mat(path: Path) -> None:
    """Numbers that were never written take two kilobytes: they are not read, though there would be room for them."""
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("x", (95_000_000,), "f8", chunks=(1 << 20,), compression="gzip")


def circular_mat(path: Path) -> None:
    """A group that contains itself."""
    import h5py

    with h5py.File(path, "w") as file:
        group = file.create_group("g")
        group["g"] = group


@pytest.mark.cases(first=1, slow=2)
@pytest.mark.parametrize(
    ("write", "words"),
    [
        (circular_mat, "nested too deeply"),
        (endless_mat, "more than 3 s"),
        (unwritten_mat, "760 MB of memory"),
        (lambda path: log_files.cells_in_cells_as_mat(path, 200_000), "crash"),  # the reader dies by a signal
        (lambda path: log_files.write_mat73(path, {}), "objects: result (timeseries)"),
    ],
    ids=["circular", "endless", "unwritten", "nested", "objects"],
)
def test_a_small_file_that_its_library_cannot_read_is_refused(
    tmp_path: Path, write: Callable[[Path], object], words: str
) -> None:
    write(tmp_path / "a.mat")
    assert (tmp_path / "a.mat").stat().st_size < 100_000
    seconds = 3.0 if write is endless_mat else LogSettings.current().time_of_reading
    with refused("log") as caught, LogSettings(time_of_reading=seconds).in_use():
        read_table(tmp_path / "a.mat")
    assert words in caught.value.actual


@pytest.mark.slow
def test_a_file_is_given_the_time_that_a_busy_machine_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit counts processor time; a file is given up only if it takes far longer."""
    slow, program = tmp_path / "slow.py", read.binary.__file__
    slow.write_text(f"import runpy, time\ntime.sleep(4.5)\nrunpy.run_path({program!r}, run_name='__main__')\n")
    monkeypatch.setattr(read.binary, "__file__", str(slow))
    zeros_as_mat(tmp_path / "a.mat", 1000)
    with LogSettings(time_of_reading=4.0).in_use():
        assert channel(read_table(tmp_path / "a.mat"), "x").values.shape == (1000,)
    zeros_as_mat(tmp_path / "b.mat", 1000)
    impatient = LogSettings(time_of_reading=4.0, patience_with_a_busy_machine=0.5)
    with impatient.in_use(), pytest.raises(LogError, match="the machine is busy"):
        read_table(tmp_path / "b.mat")


NEVER_ENDING = "import sys\nwhile True:\n    sys.stdout.buffer.write(bytes(1 << 20))\n"
READING = """
import sys
from pathlib import Path
from friso.identification.logs.read import content
from friso.identification.logs.settings import LogSettings

with LogSettings(time_of_reading=1e5).in_use():
    content("MAT", Path(sys.argv[1]))
"""


@pytest.mark.slow
def test_the_process_that_reads_ends_with_who_started_it(tmp_path: Path) -> None:
    """However that ends: a killed process cannot stop it."""
    endless_mat(tmp_path / "a.mat")
    with subprocess.Popen([sys.executable, "-c", READING, tmp_path / "a.mat"]) as parent:
        while not (children := psutil.Process(parent.pid).children()):
            assert parent.poll() is None
            time.sleep(0.01)
        parent.kill()
    children[0].wait(LIMIT)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("text", ["import os\nos.abort()\n", NEVER_ENDING], ids=["crash", "endless"])
def test_a_library_that_crashes_or_writes_for_ever_is_an_error_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    program = tmp_path / "crash.py"
    program.write_text(text, encoding="utf-8")
    monkeypatch.setattr(read.binary, "__file__", str(program))
    zeros_as_mat(tmp_path / "a.mat", 10)
    with refused("log"):
        read_table(tmp_path / "a.mat")


def test_nothing_but_numbers_and_texts_comes_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever takes over the reader cannot have the reading process call anything."""
    program, mark = tmp_path / "taken_over.py", tmp_path / "mark"
    evil = f"type('E', (), {{'__reduce__': lambda self: (__import__('os').mkdir, ({str(mark)!r},))}})()"
    program.write_text(f"import pickle, sys\nsys.stdout.buffer.write(pickle.dumps(({evil}, '')))\n", encoding="utf-8")
    monkeypatch.setattr(read.binary, "__file__", str(program))
    zeros_as_mat(tmp_path / "a.mat", 10)
    with pytest.raises(InputError):
        read_table(tmp_path / "a.mat")
    assert not mark.exists()


@pytest.mark.slow
@pytest.mark.parametrize("column", [0, 2])
def test_a_column_of_forty_thousand_digits_is_left_out(tmp_path: Path, column: int) -> None:
    """Which once took a time that grew with the square of their number."""
    rows = [[f"{k}", f"{k % 7}", f"{k % 5}"] for k in range(300)]
    for row in rows:
        row[column] = "1" * 40_000
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["time [s],position [mm],force [N]", *map(",".join, rows)]))
    read = {channel.name: channel.values for channel in read_table(path).channels}
    others = {name: k for k, name in enumerate(("time", "position", "force")) if k != column}
    assert read.keys() == others.keys()
    assert all(np.array_equal(read[name], [float(row[k]) for row in rows]) for name, k in others.items())


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("filler", [" ", "\t", '"', ",", ";", "#", "/", "[", "(", "a(", "1", "*", "-", "µ"])
def test_a_long_line_is_read_or_refused_in_a_time_like_its_length(tmp_path: Path, filler: str) -> None:
    rows = "".join(f"{k / 1000},{k % 7},{k % 5}\n" for k in range(50))
    heading = "time [s],position [mm],force [N]\n"

    def read(length: int) -> None:
        long = filler * length
        for text in (
            f"key: v{long}x\n{heading}{rows}",
            f"{long}\n{heading}{rows}",
            f"{long}\n{rows.replace(',', ' ')}",
            f"time [s],position{long}x [mm],force [N]\n{rows}",
            f"time [s],a [{long}],b in {long} mm\n{rows}",
            f"dt = {long} x y\nunits: {long}\nposition unit: {long}\ndt: 1{long}\n{heading}{rows}",
            f"{heading}{rows}0.2,{long},3\n",
        ):
            (tmp_path / "log.csv").write_text(text)
            with suppress(LogError):
                read_table(tmp_path / "log.csv")

    assert not grows_with_the_square(read)


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("text", ["time [s],position{}\n0,1\n1,2\n", "0,1\n1,2\n2,{}\n", "Name,{}\n\nName,x\n0,1\n"])
def test_a_cell_longer_than_csv_reads(tmp_path: Path, text: str) -> None:
    (tmp_path / "log.csv").write_text(text.format("x" * 200_000))
    with suppress(LogError):
        read_table(tmp_path / "log.csv")
