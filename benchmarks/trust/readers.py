"""List what friso reads: an intact example of each file, and its reader.

The function may refuse the file with an InputError and must do nothing else.
"""

import os
import signal
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import psutil

import friso
from friso.design_method.spec import load_spec
from friso.identification.logs import binary, read, roles
from friso.identification.logs.assemble import read_log
from friso.identification.logs.gaps import GapsError
from friso.identification.logs.read import is_frequency_response, read_frequency_response
from friso.stage import Stage
from friso.stage.correlations import read_correlations
from friso.studies.study import Request

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))
import log_files  # noqa: E402

RIG = ROOT / "examples" / "thesis_rig.toml"


@dataclass(frozen=True)
class Reader:
    """A kind of file: its name on disk, intact contents, and the function that reads it."""

    file: str
    contents: Callable[[], list[bytes]]
    read: Callable[[Path], Any]


def _stages() -> list[bytes]:
    return [path.read_bytes() for path in sorted((ROOT / "examples").glob("*.toml"))]


def _stage(path: Path) -> None:
    stage = friso.load(path)
    assert friso.loads(stage.to_toml()) == stage


@cache
def _uncertain() -> Stage:
    return friso.load(RIG).replace({"friction.static": "3 N +/- 1 N", "masses.cart": "1.2 kg +/- 5 %"})


def _mapping(path: Path) -> None:
    roles.load_mapping(path.with_name("log.csv"))


def _log(path: Path) -> None:
    if is_frequency_response(path):
        read_frequency_response(path)
        return
    with suppress(GapsError):  # a MAT file without units is read, and asks for them
        read_log(path, roles.Mapping(), strict=False, needed=("position", "force"))


def _binary_log(path: Path) -> None:
    """Read a log as friso does, but in a copy of this process instead of a new Python."""
    with mock.patch.object(read, "_answer", _forked):
        _log(path)


def _forked(command: list[str], seconds: float, most: int) -> bytes:
    """Run the program that reads a binary log, within its bounds of memory and time."""
    kind, file, memory, cpu, longest = command[-5:]
    held, holds = os.pipe()
    with tempfile.TemporaryFile() as out:
        child = os.fork()
        if not child:
            try:
                os.dup2(held, 0)
                os.close(holds)
                sys.stdout = open(out.fileno(), "w", closefd=False)  # noqa: SIM115
                signal.signal(signal.SIGALRM, signal.SIG_DFL)
                signal.alarm(int(seconds))
                used = psutil.Process().memory_info().vms
                binary.main(kind, Path(file), int(memory) + used if int(memory) else 0, float(cpu), float(longest))
                sys.stdout.flush()
            finally:
                os._exit(0)
        status = os.waitpid(child, 0)[1]
        os.close(held)
        os.close(holds)
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM:
            raise TimeoutError
        out.seek(0)
        return out.read(most + 1)


def _texts() -> list[bytes]:
    time = np.arange(200) * 1e-3
    rows = list(zip(time, np.sin(time * 9) * 1e-3, np.cos(time * 7), strict=True))
    points = "\n".join(f"{t:.6g},{x:.9g},{f:.6g}" for t, x, f in rows)
    german = "\n".join(f"{t:.6g};{x:.9g};{f:.6g}" for t, x, f in rows).replace(".", ",")
    response = "\n".join(f"{k};{-20 - k / 9:.3f};{-k:.1f}" for k in range(1, 80))
    twincat = "\n".join(f"{k}\t{x:.9g}\t{k}\t{f:.6g}" for k, (_, x, f) in enumerate(rows))
    texts = [
        f"time [s],position [m],force [N]\n{points}\n",
        f"Zeit [s];position [mm];force [N]\n{german}\n",
        f"f [Hz];magnitude [dB];phase [deg]\n{response}\n",
        f"Name\tScope\nFile\tx.svd\n\nName\tPosition\tName\tForce\nSampleTime[ms]\t1\tSampleTime[ms]\t1\n\n{twincat}\n",
    ]
    return [text.encode() for text in texts]


def _binaries(kind: str) -> list[bytes]:
    """Return files of measuring programs, made by the tests: MAT (four kinds), TDMS, UFF, LVM."""
    motion = log_files.motion(200)
    time, names = motion["time"], ("position", "force")
    plain = {name: motion[name] for name in names}
    named = {f"{name} [{unit}]": motion[name] for name, unit in zip(names, ("m", "N"), strict=True)}
    units = {name: (unit, motion[name]) for name, unit in zip(names, ("m", "N"), strict=True)}
    with tempfile.TemporaryDirectory() as folder:
        paths = [
            log_files.write_dspace(Path(folder, "a.mat"), named, time),
            log_files.write_structure_with_time(Path(folder, "b.mat"), named, time),
            log_files.write_mat73(Path(folder, "c.mat"), {"time": time, **plain}),
            log_files.write_mat73(Path(folder, "d.mat"), {}, named),
            log_files.write_tdms(Path(folder, "e.tdms"), units),
            log_files.write_uff(Path(folder, "f.uff"), time, units),
            log_files.write_lvm(Path(folder, "g.lvm"), units),
        ]
        return [path.read_bytes() for path in paths if path.suffix == f".{kind}"]


def _axis(path: Path) -> None:
    text = path.read_bytes().decode("utf-8", "replace")
    key, _, values = text.partition("=")
    Request(friso.load(RIG), {key: values}).study()


AXES = [
    b"controller.crossover=1 Hz..40 Hz:41",
    b"joint.stroke=0.1 mm..1 mm:9:log",
    b"joint.stroke=0.1 mm, 0.3 mm",
    b"joint.locked=true, false",
]

BINARY = ("mat", "tdms", "uff", "lvm")
"""Formats of binary logs."""

READERS = {
    "stages": Reader("stage.toml", _stages, _stage),
    "specifications": Reader(
        "spec.toml", lambda: [(ROOT / "examples" / "specs" / "thesis.toml").read_bytes()], load_spec
    ),
    "correlations": Reader(
        "stage.correlations.toml",
        lambda: [b'keys = ["friction.static", "masses.cart"]\nmatrix = [[1.0, 0.5], [0.5, 1.0]]\n'],
        lambda path: read_correlations(path, _uncertain()),
    ),
    "mappings": Reader(
        "log.csv.friso.toml",
        lambda: [
            b'sample_time = "1 ms"\nexperiment = "steps"\n\n[roles]\nposition = "x"\n\n[scales]\nforce = "3 N/V"\n'
        ],
        _mapping,
    ),
    "axes": Reader("axis.txt", lambda: AXES, _axis),
    "logs": Reader("log.csv", _texts, _log),
    **{f"{kind}-logs": Reader("log.bin", partial(_binaries, kind), _binary_log) for kind in BINARY},
}
"""Kinds of files by the name of their campaign."""
