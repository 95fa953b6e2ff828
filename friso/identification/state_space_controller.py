"""A controller given by its matrices, in the stage file or in a file of MATLAB."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import field_validator

from friso.equations.controllers.rational import FACTORS, RationalController, TransferRoots, with_filter
from friso.errors import InputError
from friso.quantities import quoted
from friso.stage import register_controller
from friso.stage.controllers import PidLike

NAMES = ("a", "b", "c", "d")


@register_controller
class StateSpace(RationalController):
    """A controller by matrices, from error to force: x' = a x + b e, F = c x + d e.

    With a `sample_time` the equations step from sample to sample. Matrices are in SI units, written as in MATLAB ("0 1;
    0 -400"), or named in a file.
    """

    kind: Literal["state_space"]
    a: str
    b: str
    c: str
    d: str = "0"
    file: str | None = None
    """A MAT file in which a, b, c and d are names of variables."""

    @field_validator("file")
    @classmethod
    def _is_found_from_anywhere(cls, file: str | None) -> str | None:
        return None if file is None else str(Path(file).absolute())

    @classmethod
    def like_pid(cls, pid: PidLike) -> dict[str, Any]:
        """Return the matrices in s: an integral, and the filter of the derivative."""
        tau = with_filter(pid)
        c, d = f"{pid.ki:.6g} {-pid.kd / tau**2:.6g}", f"{pid.kp + pid.kd / tau:.6g}"
        return {"a": f"0 0; 0 {-1 / tau:.6g}", "b": "1; 1", "c": c, "d": d, "file": None, **FACTORS}

    @classmethod
    def roots(cls, flat: Mapping[str, Any]) -> TransferRoots:
        """Return the zeros and poles of the matrices.

        Raises InputError for unusable matrices, or if no error makes a force.
        """
        a, b, c, d = _matrices(flat)
        size = len(a)
        poles = np.linalg.eigvals(a)
        if (through := float(d[0, 0])) != 0:
            return TransferRoots(np.linalg.eigvals(a - b @ c / through), poles, through)
        moments = [float((c @ np.linalg.matrix_power(a, k) @ b)[0, 0]) for k in range(size)]
        scale = np.abs(c).max() * np.abs(b).max()
        least = 1e-12 * scale * max(1.0, np.abs(a).max()) ** np.arange(size)
        first = next((k for k, h in enumerate(moments) if abs(h) > least[k]), None)
        if first is None:
            raise InputError("controller", "matrices by which no error makes a force", "a controller that acts")
        pencil = np.block([[a, b], [c, d]])
        shift = 1.0 + np.abs(poles).max(initial=0.0)  # at a point that is no pole the Rosenbrock matrix is regular
        mass = np.zeros_like(pencil)
        mass[:size, :size] = np.eye(size)
        inverse = np.linalg.eigvals(np.linalg.solve(pencil - shift * mass, mass))
        finite = sorted(inverse, key=abs, reverse=True)[: size - first - 1]
        return TransferRoots(shift + 1 / np.array(finite, complex), poles, moments[first])


def _matrices(flat: Mapping[str, Any]) -> list[np.ndarray]:
    """Return the matrices a, b, c and d.

    Raises InputError if a matrix is missing or has a wrong shape.
    """
    texts = [flat[f"controller.{name}"] for name in NAMES]
    if (file := flat.get("controller.file")) is None:
        matrices = [_parsed(name, text) for name, text in zip(NAMES, texts, strict=True)]
    else:
        matrices = _from_file(Path(file), texts)
    size = len(matrices[0])
    expected = {"a": (size, size), "b": (size, 1), "c": (1, size), "d": (1, 1)}
    for name, matrix in zip(NAMES, matrices, strict=True):
        if matrix.shape != expected[name] or not np.all(np.isfinite(matrix)):
            needed, shape = (" x ".join(map(str, sizes)) for sizes in (expected[name], matrix.shape))
            actual = f"a matrix of {shape}"
            raise InputError(f"controller.{name}", actual, f"{needed} numbers: one error, one force")
    return matrices


def _parsed(name: str, text: str) -> np.ndarray:
    """Parse a matrix that is written as in MATLAB.

    Raises InputError for a text that is no matrix.
    """
    rows = [row.replace(",", " ").split() for row in text.strip().strip("[]").split(";") if row.strip()]
    try:
        return np.array([[float(number) for number in row] for row in rows]).reshape(len(rows), -1)
    except ValueError:
        key, expected = f"controller.{name}", "a matrix, rows divided by semicolons"
        raise InputError(key, quoted(text), expected, f'{name} = "0 1; 0 -400"') from None


def _from_file(path: Path, names: list[str]) -> list[np.ndarray]:
    """Return matrices by their names in a file of MATLAB.

    Raises InputError for a missing file or variable.
    """
    from friso.identification.logs.binary import is_hdf5
    from friso.identification.logs.read import content, content_by

    if not path.is_file():
        raise InputError("controller.file", quoted(str(path)), "a MAT file with the matrices", '"controller.mat"')
    with path.open("rb") as file:
        newer = is_hdf5(file.read(520))
    tree = content_by("h5py", "MAT", path) if newer else content("MAT", path)
    matrices = []
    for key, name in zip(NAMES, names, strict=True):
        if name not in tree:
            if name == "0" and key == "d":
                matrices.append(np.zeros((1, 1)))
                continue
            listed = ", ".join(map(str, tree)) or "nothing"
            raise InputError(f"controller.{key}", quoted(name), f"a variable of {path.name}, which has {listed}")
        matrix = np.atleast_1d(np.asarray(tree[name], float))
        size = {"b": (-1, 1), "c": (1, -1)}.get(key)
        matrices.append(matrix.reshape(size) if size and matrix.ndim == 1 else np.atleast_2d(matrix))
    return matrices
