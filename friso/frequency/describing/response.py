"""Compute the frequency response of a plant with friction, as a drive measures it.

The response depends on the amplitude of the force. The analyser divides the first harmonic of the position by the force
(Gelb, Vander Velde 1968, quasi-linear response). One force may have several responses. Those at which the force falls
with the amplitude are unstable; which of the others appears depends on the history of the analyser.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.tolerance import checked_rtol
from friso.frequency.describing.driven import DrivenPlant, Roots, driven_amplitudes
from friso.frequency.describing.function import checked_positive
from friso.frequency.describing.loop import TOUCHES, beyond_stroke
from friso.frequency.describing.steady import RTOL
from friso.frequency.settings import settings
from friso.stage import Stage
from friso.stage.arguments import check_arguments

if TYPE_CHECKING:
    import xarray as xr

NOT_FOUND = "no amplitude was found at which this force moves the cart"
MISSING = "answers are missing: friction was not found at some amplitude, or the least or greatest answer does not last"


@check_arguments
def plant_response(
    stage: Stage,
    forces: Sequence[float] | np.ndarray,
    frequencies: Sequence[float] | np.ndarray,
    rtol: float = RTOL,
) -> xr.Dataset:
    """First-harmonic response of the plant to sinusoidal actuator forces `forces` [N].

    A force may have several answers, or branches. Variables over ("force", "frequency", "branch") are in order of
    rising amplitude, NaN where there are fewer branches:

    - `response`: stage position over force [m/N], complex; `cart_response` [m/N]: that of the cart.
    - `amplitude` [m] of the cart, and `stiffness` of friction [N/m], complex.
    - `lasting`: 1 if the force rises with the amplitude, so that the branch is stable, 0 if it falls, else NaN.
    - `error`: relative error of the force.

    Variables over ("force", "frequency"):

    - `up` and `down`: the response [m/N] that an analyser shows. It starts at rest at the lowest (or highest)
      frequency, and steps to the others in turn. Of the lasting branches it shows the one nearest in amplitude to the
      branch before, NaN where none lasts.
    - `answers`: the number of branches.
    - `status`: what is wrong, also with forces and frequencies that are beyond what can be computed, or "done".

    The answers to one force do not depend on the other forces. Raises InputError for a stage without friction, and for
    forces, frequencies or an `rtol` that are not usable.

    Examples
    --------
    >>> import friso
    >>> friso.plant_response(friso.load("rig.toml"), [2.0], [5.0, 10.0])["up"]  # doctest: +SKIP
    """
    import xarray as xr

    sizes, rates = checked_positive("forces", forces, "2 N"), checked_positive("frequencies", frequencies, "10 Hz")
    driven = DrivenPlant.of(stage.flat(), rates, checked_rtol(rtol))
    branch_points = driven_amplitudes(driven, sizes)
    plane, place, count = ("force", "frequency"), *_branches(branch_points, (len(sizes), len(rates)))
    columns = _columns(driven, branch_points)
    branches = {name: _spread(values, place, count.shape) for name, (values, _, _) in columns.items()}
    variables: dict[str, Any] = {
        name: ((*plane, "branch"), branches[name], _words(unit, text)) for name, (_, unit, text) in columns.items()
    }
    for name, order in (("up", 1), ("down", -1)):
        variables[name] = (
            plane,
            _on_branch(branches, order),
            _words("m/N", f"stage position over force, stepping {name}"),
        )
    variables["answers"] = (plane, count, _words("1", "number of answers"))
    variables["status"] = (plane, _status(stage, branches, sizes, branch_points.unknown))
    coords = {
        "force": ("force", sizes, _words("N", "amplitude of the actuator force")),
        "frequency": ("frequency", rates, _words("Hz", "frequency")),
    }
    return stage.axis_kind.with_units(xr.Dataset(variables, coords, {"stage": stage.to_toml(), "rtol": rtol}))


def _columns(driven: DrivenPlant, branch_points: Roots) -> dict[str, tuple[np.ndarray, str, str]]:
    """Return the quantities of every root by name: values, SI unit, and a description.

    `branch_points` are the roots, the amplitudes at which forces move the plant `driven`.
    """
    _, positions, stiffness = driven.answer(branch_points.amplitude, branch_points.frequency)
    return {
        "response": (positions[:, 0], "m/N", "stage position over force"),
        "cart_response": (positions[:, 1], "m/N", "cart position over force"),
        "amplitude": (branch_points.amplitude, "m", "amplitude of the cart"),
        "stiffness": (stiffness, "N/m", "dynamic stiffness of friction"),
        "lasting": (branch_points.rising.astype(float), "1", "whether the motion lasts"),
        "error": (branch_points.error, "1", "relative error of the force"),
    }


def _words(unit: str, text: str) -> dict[str, str]:
    return {"units": unit, "long_name": text}


def _branches(branch_points: Roots, shape: tuple[int, int]) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Return indices of every root in the result, and how many roots each pair has.

    A pair is a force at a frequency. The indices are those of force, frequency, and rank by rising amplitude; the
    counts have the shape (forces, frequencies).
    """
    cell = branch_points.force * shape[1] + branch_points.frequency
    count = np.bincount(cell, minlength=shape[0] * shape[1])
    order = np.lexsort((branch_points.amplitude, cell))
    number = np.empty(len(cell), np.int64)
    number[order] = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
    return (branch_points.force, branch_points.frequency, number), count.reshape(shape)


def _spread(values: np.ndarray, place: tuple[np.ndarray, ...], shape: tuple[int, int]) -> np.ndarray:
    """Spread the roots' values over an array of force, frequency and branch, NaN elsewhere.

    `place` has the indices of each root.
    """
    array = np.full((*shape, int(place[2].max(initial=0)) + 1), np.nan, values.dtype)
    array[place] = values
    return array


def _on_branch(branches: dict[str, np.ndarray], order: int) -> np.ndarray:
    """Return the response [m/N] that an analyser shows, shape (forces, frequencies).

    The analyser steps up (`order` 1) or down (-1) in frequency. The result is NaN where no branch is stable.
    """
    chosen = _followed(branches["amplitude"], branches["lasting"], order)[:, :, None]
    answer, lasting = (np.take_along_axis(branches[name], chosen, axis=2)[:, :, 0] for name in ("response", "lasting"))
    return np.where(lasting == 1, answer, np.nan)


def _followed(amplitudes: np.ndarray, lasting: np.ndarray, order: int) -> np.ndarray:
    """Return the number of the branch that an analyser shows at every frequency.

    The shape is (forces, frequencies). The analyser steps up (`order` 1) or down (-1), and shows the stable branch
    (`lasting`) nearest in amplitude to the previous one; at the start, the smallest.
    """
    sizes = np.where(lasting == 1, np.log(amplitudes), np.inf)
    chosen = np.zeros(sizes.shape[:2], np.int64)
    before = np.full(len(sizes), -np.inf)
    rows = np.arange(len(sizes))
    for j in range(sizes.shape[1])[::order]:
        far = np.where(np.isfinite(before)[:, None], np.abs(sizes[:, j] - before[:, None]), sizes[:, j])
        chosen[:, j] = np.argmin(far, axis=1)
        now = sizes[rows, j, chosen[:, j]]
        before = np.where(np.isfinite(now), now, before)
    return chosen


def _status(stage: Stage, branches: dict[str, np.ndarray], forces: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    """Return what is wrong with the responses, or "done", shape (forces, frequencies).

    `branches` has the quantities over force, frequency and branch. `unknown` marks where friction was not found.
    """
    present, lasting = ~np.isnan(branches["amplitude"]), branches["lasting"]
    count = np.sum(present, axis=2)
    last = np.take_along_axis(lasting, np.maximum(count - 1, 0)[:, :, None], axis=2)[:, :, 0]
    missing = unknown | (lasting[:, :, 0] != 1) | (last != 1)
    unfound = (count == 0) | np.any(present & ~(branches["error"] <= 100 * settings.force_error), axis=2)
    deflection = np.abs(branches["response"] - branches["cart_response"]) * forces[:, None, None]
    status = np.where(missing, MISSING, "done").astype(object)
    status[np.any(beyond_stroke(stage.flat(), deflection), axis=2)] = TOUCHES
    status[unfound] = NOT_FOUND
    return status.astype(str)
