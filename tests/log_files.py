"""Sample logs of every format, written by the tests: text, TwinCAT Scope CSV, MAT, TDMS, UFF, LVM."""

import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

STEP = 1e-3


def motion(n: int = 400, step: float = STEP) -> dict[str, np.ndarray]:
    """A mass of 2 kg pushed by a sine: time [s], position [m], velocity [m/s], force [N], each of shape (n,)."""
    time = step * np.arange(n)
    w = 2 * np.pi * 7
    return {
        "time": time,
        "position": 0.05 * np.sin(w * time) + 0.01 * np.sin(3.3 * w * time),
        "velocity": 0.05 * w * np.cos(w * time) + 0.01 * 3.3 * w * np.cos(3.3 * w * time),
        "force": -2 * w**2 * (0.05 * np.sin(w * time) + 0.01 * 3.3**2 * np.sin(3.3 * w * time)),
    }


def write_text(
    path: Path,
    heading: Sequence[str],
    columns: Sequence[np.ndarray],
    delimiter: str = ",",
    decimal: str = ".",
    encoding: str = "utf-8",
    before: str = "",
    units: Sequence[str] = (),
) -> Path:
    """A table of numbers; shorter columns end in empty cells."""
    lines = [before] if before else []
    lines += [delimiter.join(heading)] if heading else []
    lines += [delimiter.join(units)] if units else []
    for i in range(max(map(len, columns))):
        cells = [repr(float(c[i])).replace(".", decimal) if i < len(c) else "" for c in columns]
        lines.append(delimiter.join(cells))
    path.write_bytes(("\n".join(lines) + "\n").encode(encoding))
    return path


def write_twincat(
    path: Path,
    groups: Sequence[tuple[float, Sequence[tuple[str, str, np.ndarray]]]],
    delimiter: str = "\t",
    decimal: str = ",",
    start: int | None = None,
    end_mark: bool = True,
    full: bool = True,
) -> Path:
    """Write a log as Scope 3.4 exports it.

    Groups are (sample time [ms], channels (name, unit, values)), each with a time column in ms, or in 100 ns since 1601
    from `start` on; `full` adds the rows of keys under the names.
    """
    rows: list[list[str]] = [["Name", "rig"], ["File", "rig.csv"]]
    rows += [["Starttime of export", "132959733843760000", "Montag, 2. Mai 2022", "15:56:24.376"]] * full + [[], []]

    def keys(key: str, pick: Any) -> list[str]:
        return [cell for step, channels in groups for cell in (key, *(pick(step, *channel) for channel in channels))]

    rows.append(keys("Name", lambda step, name, unit, values: name))
    if full:
        rows.append(keys("SymbolComment", lambda *_: ""))
        rows.append(keys("Data-Type", lambda *_: "REAL64"))
        rows.append(keys("SampleTime[ms]", lambda step, *_: f"{step:g}".replace(".", decimal)))
        rows.append(keys("SymbolName", lambda step, name, unit, values: f"MAIN.{name}"))
        rows.append(keys("Offset", lambda *_: "1"))
        rows.append(keys("ScaleFactor", lambda *_: "-1"))
        rows.append(keys("Unit", lambda step, name, unit, values: unit or "(None)"))
    rows.append([])
    for i in range(max(len(channels[0][2]) for _, channels in groups)):
        cells: list[str] = []
        for step, channels in groups:
            there = i < len(channels[0][2])
            stamp = f"{start + round(i * step * 1e4)}" if start else f"{i * step:.10g}"
            cells += [stamp if there else "", *(repr(float(v[i])) if there else "" for _, _, v in channels)]
        rows.append([cell.replace(".", decimal) for cell in cells])
    rows += [["EOF"]] * end_mark
    path.write_text("\n".join(delimiter.join(row) for row in rows) + "\n", encoding="utf-8")
    return path


def write_dspace(path: Path, signals: dict[str, np.ndarray], time: np.ndarray, name: str = "exp1") -> Path:
    """A dSPACE recording: `X.Data`, `Y(i).Name`, `Y(i).Data`, `Y(i).XIndex`."""
    from scipy.io import savemat

    kind = [("Name", object), ("Data", object), ("Unit", object), ("XIndex", object)]
    y = np.array([(heading, values, "", 1) for heading, values in signals.items()], dtype=kind)
    savemat(path, {name: {"X": {"Name": "", "Data": time}, "Y": y}})
    return path


def write_structure_with_time(path: Path, signals: dict[str, np.ndarray], time: np.ndarray) -> Path:
    """Simulink's structure with time, signals with labels."""
    from scipy.io import savemat

    kind = [("values", object), ("label", object)]
    rows = np.array([(values[:, None], label) for label, values in signals.items()], dtype=kind)
    savemat(path, {"out": {"time": time[:, None], "signals": rows}})
    return path


def write_mat73(path: Path, arrays: dict[str, np.ndarray], dspace: dict[str, np.ndarray] | None = None) -> Path:
    """MATLAB 7.3: HDF5 behind a block of 512 bytes; arrays transposed; a dSPACE structure array by references; an
    object that only MATLAB can read."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays.items():
            item = file.create_dataset(name, data=np.atleast_2d(values))
            item.attrs["MATLAB_class"] = np.bytes_("double")
        secret = file.create_dataset("result", data=np.zeros((1, 6), dtype=np.uint32))
        secret.attrs["MATLAB_class"] = np.bytes_("timeseries")
        secret.attrs["MATLAB_object_decode"] = np.int32(3)
        if dspace is not None:
            _dspace73(file, dspace)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + b" " * 8 + b"\x00\x02IM")
    return path


def _dspace73(file: Any, signals: dict[str, np.ndarray]) -> None:
    import h5py

    experiment, refs = file.create_group("exp1"), file.create_group("#refs#")
    experiment.attrs["MATLAB_class"] = np.bytes_("struct")
    x, y = experiment.create_group("X"), experiment.create_group("Y")
    size = len(next(iter(signals.values())))
    x.create_dataset("Data", data=STEP * np.arange(size)[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    for key in ("Name", "Data"):
        references = []
        for i, (heading, values) in enumerate(signals.items()):
            data = np.array([[ord(c)] for c in heading], dtype=np.uint16) if key == "Name" else values[None, :]
            item = refs.create_dataset(f"{key}{i}", data=data)
            item.attrs["MATLAB_class"] = np.bytes_("char" if key == "Name" else "double")
            references.append(item.ref)
        y.create_dataset(key, data=np.array(references, dtype=h5py.ref_dtype)[:, None], dtype=h5py.ref_dtype)


def write_tdms(path: Path, signals: dict[str, tuple[str, np.ndarray]], step: float = STEP) -> Path:
    """NI TDMS: waveforms with their step and unit."""
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        for name, (unit, values) in signals.items():
            properties = {"wf_increment": step, "wf_start_offset": 0.0, "unit_string": unit}
            writer.write_segment([ChannelObject("rig", name, values, properties)])
    return path


def write_uff(path: Path, x: np.ndarray, signals: dict[str, tuple[str, np.ndarray]], kind: int = 1) -> Path:
    """Universal file, dataset 58: function type 1 time history, 4 frequency response, 6 coherence."""
    import pyuff

    for name, (unit, values) in signals.items():
        above, _, below = unit.partition("/")
        data = pyuff.prepare_58(
            func_type=6 if name == "coherence" else kind, rsp_node=1, rsp_dir=3, ref_node=2, ref_dir=3, data=values,
            x=x, id1=name, ordinate_axis_units_lab=above or "NONE", orddenom_axis_units_lab=below or "NONE",
            abscissa_spec_data_type=17 if kind == 1 else 18, abscissa_spacing=1,
            ordinate_spec_data_type=8, orddenom_spec_data_type=13, z_axis_spec_data_type=0, binary=0,
        )  # fmt: skip
        pyuff.UFF(str(path)).write_sets([data], "add")
    return path


def write_lvm(path: Path, signals: dict[str, tuple[str, np.ndarray]], step: float = STEP) -> Path:
    """LabVIEW measurement text, one X column."""
    names, count = list(signals), len(signals)
    size = len(next(iter(signals.values()))[1])

    def row(key: str, value: str) -> str:
        return "\t".join([key, *[value] * count, ""])

    head = ["LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab", "Decimal_Separator\t."]
    head += ["Multi_Headings\tNo", "X_Columns\tOne", "Time_Pref\tRelative", "***End_of_Header***\t", "\t"]
    head += [f"Channels\t{count}" + "\t" * count, row("Samples", str(size))]
    head += ["\t".join(["Y_Unit_Label", *(unit for unit, _ in signals.values()), ""])]
    head += [row("X_Dimension", "Time"), row("X0", "0.0"), row("Delta_X", f"{step:.6f}")]
    head += ["***End_of_Header***" + "\t" * (count + 1), "\t".join(["X_Value", *names, "Comment"])]
    for i in range(size):
        head.append("\t".join([f"{i * step:.6f}", *(f"{values[i]:.9f}" for _, values in signals.values())]))
    path.write_text("\n".join(head) + "\n", encoding="utf-8")
    return path


def cells_in_cells_as_mat(path: Path, levels: int) -> None:
    """A small MAT file of cells within cells, compressed."""
    above = ((6, 8, 1, 0), (5, 8, 1, 1), (1, 0))
    parts = [(14, 48 * (levels + 1)), *above] * levels
    number = struct.pack("<14id", 14, 56, 6, 8, 6, 0, 5, 8, 1, 1, 1, 0, 9, 8, 1.0)
    data = zlib.compress(b"".join(struct.pack(f"<{len(part)}i", *part) for part in parts) + number, 9)
    head = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + struct.pack("<H", 0x0100) + b"IM"
    path.write_bytes(head + struct.pack("<ii", 15, len(data)) + data)
