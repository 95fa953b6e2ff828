"""Write one record in many variants, as drives, loggers and people write them, and tell how each is read.

``python -m benchmarks.log_variants`` prints the table of docs/evidence/logs.md.
"""

import bz2
import gzip
import json
import lzma
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from friso.errors import InputError
from friso.identification.logs.assemble import read_log
from friso.identification.logs.gaps import GapsError

STEP = 1e-3
TIME = STEP * np.arange(3000)
FORCE = 12 * np.sin(2 * np.pi * 1.3 * TIME) + 7 * np.sin(2 * np.pi * 0.37 * TIME)
POSITION = 1e-3 * np.round(1e7 * np.cumsum(np.cumsum(FORCE / 5)) * STEP**2) / 1e4 + 1.5
HEADS = ("time [s]", "position [mm]", "force [N]")
RIGHT, ASKS, REFUSED, MISREAD = "right", "asks", "refused", "MISREAD"


def columns(time: float = 1.0, position: float = 1e3, force: float = 1.0) -> list[np.ndarray]:
    """Return time, position and force in units of which there are so many in s, m and N."""
    return [time * TIME, position * POSITION, force * FORCE]


def text(
    heads: Sequence[str] = HEADS,
    values: Sequence[Sequence[object] | np.ndarray] | None = None,
    sep: str = ",",
    write: Callable[[float], str] = lambda value: f"{value:.6f}",
    above: str = "",
    below: str = "",
    end: str = "\n",
) -> str:
    """Write a table of the record, or of other columns, as text."""
    rows = zip(*(columns() if values is None else values), strict=True)
    cells = ([cell if isinstance(cell, str) else write(float(cell)) for cell in row] for row in rows)  # pyright: ignore
    lines = [*([above] if above else []), *([sep.join(heads)] if heads else []), *(sep.join(row) for row in cells)]
    return end.join([*lines, *([below] if below else []), ""])


def comma(value: float) -> str:
    """Write a number with a decimal comma."""
    return f"{value:.6f}".replace(".", ",")


def grouped(value: float, group: str, decimal: str = ".") -> str:
    """Write a number whose thousands are grouped."""
    return f"{value:,.6f}".replace(",", "\0").replace(".", decimal).replace("\0", group)


def _stamps(form: str) -> list[str]:
    """Write the instants as dates and times of a form of strftime; %f is cut to milliseconds."""
    stamps = pd.Timestamp("2026-03-14 09:26:53") + pd.to_timedelta(np.round(TIME * 1e3), "ms")
    return [stamp.strftime(form)[: -3 if form.endswith("%f") else None] for stamp in stamps]


def variants() -> dict[str, tuple[str, str | bytes]]:
    """Return the variants: by name the file's name and content."""
    x, y, f = columns()
    minutes = [f"{int(t // 60)}:{t % 60:06.3f}" for t in TIME + 55]
    german, plain = text(sep=";", write=comma), text()
    frame = pd.DataFrame(dict(zip(HEADS, columns(), strict=True)))
    sparse = [
        f"{t:.6f},{a:.6f}," if i % 2 else f"{t:.6f},,{b:.6f}" for i, (t, a, b) in enumerate(zip(x, y, f, strict=True))
    ]
    scope = "\n".join(["Model,TDS2014", "Sample Interval,1e-3,s", "Record Length,3000", plain])
    tek = "\n".join(
        f"{key},{t:.6f},{a:.6f},{b:.6f}" for key, t, a, b in zip(["Record Length", *[""] * 2999], x, y, f, strict=True)
    )
    out: dict[str, tuple[str, str | bytes]] = {
        "comma": ("a.csv", plain),
        "tab": ("a.txt", text(sep="\t")),
        "bar": ("a.txt", text(sep="|")),
        "spaces, aligned": ("a.txt", text(heads=("time[s]", "position[mm]", "force[N]"), sep="   ")),
        "semicolon, decimal comma": ("a.csv", german),
        "tab, decimal comma": ("a.csv", text(sep="\t", write=comma)),
        "comma in quotes, decimal comma": ("a.csv", text(write=lambda v: f'"{comma(v)}"')),
        "exponents": ("a.csv", text(write=lambda v: f"{v:.9E}")),
        "exponents of Fortran": ("a.csv", text(write=lambda v: f"{v:.9E}".replace("E", "D"))),
        "thousands grouped by apostrophes": ("a.csv", text(sep=";", write=lambda v: grouped(v, "'"))),
        "thousands grouped by points": ("a.csv", text(sep=";", write=lambda v: grouped(v, ".", ","))),
        "thousands grouped by commas, quoted": ("a.csv", text(write=lambda v: f'"{grouped(v, ",")}"')),
        "thousands grouped by thin spaces": ("a.csv", text(sep=";", write=lambda v: grouped(v, "\u202f", ","))),
        "minus of typesetters": ("a.csv", text(write=lambda v: f"{v:.6f}".replace("-", "\u2212"))),
        "every cell quoted": ("a.csv", text(write=lambda v: f'"{v:.6f}"')),
        "lines end with a delimiter": ("a.csv", plain.replace("\n", ",\n")),
        "CR LF": ("a.csv", text(end="\r\n")),
        "CR alone": ("a.csv", text(end="\r")),
        "UTF-8 with a byte order mark": ("a.csv", b"\xef\xbb\xbf" + plain.encode()),
        "UTF-16": ("a.csv", plain.encode("utf-16")),
        "UTF-16 without a mark": ("a.csv", plain.encode("utf-16-le")),
        "Windows-1252, with µm": (
            "a.csv",
            text(("time [s]", "position [µm]", "force [N]"), columns(position=1e6)).encode("cp1252"),
        ),
        "end mark of DOS": ("a.csv", plain + "\x1a"),
        "comments above": ("a.csv", text(above="# rig 7, operator KM\n# 2026-03-14")),
        "key and value above": ("a.csv", text(above="Device: AX5206\nFirmware: 2.10\n")),
        "units in a row of their own": (
            "a.csv",
            text(("time", "position", "force"), above="").replace("force\n", "force\ns,mm,N\n", 1),
        ),
        "units in parentheses": ("a.csv", text(("time (s)", "position (mm)", "force (N)"))),
        "units over a slash": ("a.csv", text(("t/s", "position/mm", "force/N"))),
        "units behind an underscore": ("a.csv", text(("time_ms", "position_mm", "force_N"), columns(time=1e3))),
        "units in words (in mm)": ("a.csv", text(("time in s", "position in mm", "force in N"))),
        "micrometres and millinewtons": (
            "a.csv",
            text(("time [us]", "pos [um]", "force [mN]"), columns(1e6, 1e6, 1e3)),
        ),
        "German headings": ("a.csv", text(("Zeit [s]", "Istposition [mm]", "Kraft [N]"), sep=";", write=comma)),
        "French headings": ("a.csv", text(("temps [s]", "position [mm]", "force [N]"), sep=";", write=comma)),
        "no units": ("a.csv", text(("time", "position", "force"))),
        "no heading": ("a.csv", text(())),
        "current instead of a force": ("a.csv", text(("time [s]", "position [mm]", "current [A]"))),
        "sample rate above, no time": ("a.csv", text(HEADS[1:], columns()[1:], above="Sample rate: 1000 Hz")),
        "neither rate nor time": ("a.csv", text(HEADS[1:], columns()[1:])),
        "milliseconds": ("a.csv", text(("time [ms]", *HEADS[1:]), columns(time=1e3))),
        "ms as heading over seconds": ("a.csv", text(("time [ms]", *HEADS[1:]))),
        "stamps, ISO 8601": ("a.csv", text(("time", *HEADS[1:]), [_stamps("%Y-%m-%dT%H:%M:%S.%f"), y, f])),
        "stamps, day first": ("a.csv", text(("time", *HEADS[1:]), [_stamps("%d.%m.%Y %H:%M:%S.%f"), y, f])),
        "stamps, time of day": ("a.csv", text(("time", *HEADS[1:]), [_stamps("%H:%M:%S.%f"), y, f])),
        "stamps, mm:ss.sss": ("a.csv", text(("time", *HEADS[1:]), [minutes, y, f])),
        "stamps of whole seconds": ("a.csv", text(("time", *HEADS[1:]), [_stamps("%H:%M:%S"), y, f])),
        "seconds since 1970": ("a.csv", text(("timestamp", *HEADS[1:]), [x + 1.7e9, y, f])),
        "microseconds of 32 bits that wrap": (
            "a.csv",
            text(("time [us]", *HEADS[1:]), [(x * 1e6 + 2**32 - 1e6) % 2**32, y, f]),
        ),
        "rows of two topics on one clock": ("a.csv", "\n".join([",".join(HEADS), *sparse, ""])),
        "a word among the numbers": ("a.csv", plain.replace(plain.splitlines()[1500], "error,0,0")),
        "a row cut short": ("a.csv", plain.replace(plain.splitlines()[1500], "1.5")),
        "two lost rows": (
            "a.csv",
            plain.replace(plain.splitlines()[1500] + "\n", "").replace(plain.splitlines()[1501] + "\n", ""),
        ),
        "oscilloscope: keys above": ("a.csv", scope),
        "old Tektronix: keys beside": ("a.csv", tek),
        "gzip": ("a.csv.gz", gzip.compress(plain.encode())),
        "bzip2": ("a.csv.bz2", bz2.compress(plain.encode())),
        "xz": ("a.csv.xz", lzma.compress(plain.encode())),
        "JSON, lists by name": ("a.json", json.dumps({name: frame[name].tolist() for name in frame})),
        "JSON, records": ("a.json", str(frame.to_json(orient="records"))),
        "JSON, a record a line": ("a.json", str(frame.to_json(orient="records", lines=True))),
        "JSON of pandas": ("a.json", str(frame.to_json())),
    }
    return out


def binary_variants(folder: Path) -> dict[str, Path]:
    """Write the variants that libraries write; return their paths by name."""
    from scipy.io import savemat

    arrays = dict(zip(("time_s", "position_mm", "force_N"), columns(), strict=True))
    np.savez(folder / "a.npz", **arrays)
    np.save(folder / "a.npy", np.stack(columns(), axis=1))
    savemat(folder / "a.mat", arrays)
    savemat(folder / "nested.mat", {"run": {"rig": arrays}})
    with zipfile.ZipFile(folder / "a.zip", "w") as archive:
        archive.writestr("log.csv", text())
    with zipfile.ZipFile(folder / "two.zip", "w") as archive:
        archive.writestr("a.csv", text())
        archive.writestr("b.csv", text())
    names = {"NPZ": "a.npz", "NPY, a matrix": "a.npy", "MAT": "a.mat", "MAT, nested structures": "nested.mat"}
    return {name: folder / file for name, file in (names | {"ZIP": "a.zip", "ZIP of two files": "two.zip"}).items()}


def verdict(path: Path) -> tuple[str, str]:
    """Read a file as it stands; return how it was read, and what friso says of it."""
    try:
        log = read_log(path, needed=("position", "force"), foreign=("force",))
    except GapsError as error:
        return ASKS, "; ".join(gap.example or gap.expected for gap in error.gaps)
    except InputError as error:
        return REFUSED, f"{error.actual}; expected {error.expected}"
    position, force = log["position"], log["force"]
    own = log.time - (log.time[0] if log.time[0] > 5 * STEP else 0.0)  # a topic may begin a few rows late
    right = abs(own[-1] - TIME[-1]) < 5 * STEP
    for values, truth in ((position, POSITION), (force, FORCE)):
        off = np.abs(np.interp(TIME, own, values) - truth)[5:-5].max() if right else np.inf
        right = right and bool(off < 2e-3 * np.ptp(truth))
    said = "; ".join(log.warnings) if log.warnings else ""
    return (RIGHT, said) if right else (MISREAD, said)


def table(folder: Path) -> list[tuple[str, str, str]]:
    """Return name, verdict and remark of all variants, written into a folder."""
    rows = []
    for number, (name, (file, content)) in enumerate(variants().items()):
        path = folder / f"{number}_{file}"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        rows.append((name, *verdict(path)))
    return [*rows, *((name, *verdict(path)) for name, path in binary_variants(folder).items())]


def main() -> None:
    """Print the table in Markdown."""
    with tempfile.TemporaryDirectory() as folder:
        rows = table(Path(folder))
    print("| variant | read | what friso says |\n|---|---|---|")
    for name, how, remark in rows:
        print(f"| {name} | {how} | {remark[:150].replace('|', '/').replace(chr(10), ' ')} |")
    print("\n" + ", ".join(f"{sum(row[1] == how for row in rows)} {how}" for how in (RIGHT, ASKS, REFUSED, MISREAD)))


if __name__ == "__main__":
    main()
