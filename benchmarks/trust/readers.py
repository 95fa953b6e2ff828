"""What friso reads: a sound example of each kind of file, and the function that reads it, which may refuse it with an
InputError and must do nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import friso
from friso.design.spec import load_spec
from friso.identify.logs import mapping
from friso.identify.logs.assemble import read_log
from friso.identify.logs.read import is_frequency_response, read_frequency_response
from friso.stage import Stage
from friso.stage.correlations import read_correlations
from friso.studies.request import Request

ROOT = Path(__file__).parents[2]
RIG = ROOT / "examples" / "thesis_rig.toml"


@dataclass(frozen=True)
class Reader:
    """A kind of file: its name on disk, sound contents, and what reads it."""

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
    mapping.load(path.with_name("log.csv"))


def _log(path: Path) -> None:
    if is_frequency_response(path):
        read_frequency_response(path)
    else:
        read_log(path, mapping.Mapping(), strict=False, needed=("position", "force"))


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


def _binaries() -> list[bytes]:
    """MAT files of versions 5 and 7.3, and TDMS."""
    import tempfile

    import h5py
    import nptdms
    from scipy.io import savemat

    values = {"time": np.arange(300) * 1e-3, "position": np.sin(np.arange(300.0)), "force": np.cos(np.arange(300.0))}
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / name for name in ("a.mat", "b.mat", "c.tdms")]
        savemat(paths[0], values)
        with h5py.File(paths[1], "w", userblock_size=512) as file:
            for name, value in values.items():
                file[name] = value.reshape(-1, 1)
        with nptdms.TdmsWriter(paths[2]) as writer:
            writer.write_segment([nptdms.ChannelObject("log", name, value) for name, value in values.items()])
        return [path.read_bytes() for path in paths]


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
    "binary-logs": Reader("log.mat", _binaries, _log),
}
"""The kinds by the name of their campaign."""
