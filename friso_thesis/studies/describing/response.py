"""Compute the frequency response of a plant with friction, as a drive measures it.

The response depends on the amplitude of the force. The analyser divides the first harmonic of the position by the force
(Gelb, Vander Velde 1968, quasi-linear response). One force may have several responses. Those at which the force falls
with the amplitude are unstable; which of the others appears depends on the history of the analyser.

The motions under a sinusoidal force are solved for first. Masses, joint and parasitic mode are linear; friction acts on
the cart through its describing function N(A, omega). A force of amplitude Phi on the stage moves the cart by x_c = H_cs
Phi - H_cc N x_c. So its amplitude A is a root of A abs(1 + H_cc N(A)) / abs(H_cs) = Phi, where H are the compliances of
the masses without friction. A force may have several roots. The mass line of a plant with friction is computed at
several places (thesis, Fig. 17).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize.elementwise import find_root

from friso.engine.allowance import checked_rtol
from friso.frequency.loops import mechanics
from friso.stage import Stage
from friso.stage.arguments import check_arguments
from friso_thesis.studies.describing.balance import TOUCHES, beyond_stroke
from friso_thesis.studies.describing.function import IMPOSED_RTOL, Imposition, checked_positive, dynamic_stiffness

if TYPE_CHECKING:
    import xarray as xr

AMPLITUDE_LIMITS = (1e-18, 1e18)
"""Smallest and largest amplitude [m] of the search."""


STUCK_AMPLITUDE = 1e-3
"""Amplitude below which bristles are springs, in units of the scale of the law's state."""

STATELESS_AMPLITUDE = 1e-12  # [m]
"""Amplitude scale of a law without a state of its own, far below any motion that matters."""

FREE_AMPLITUDE = 10.0
"""Amplitude, relative to that of a cart without friction, beyond which friction does not matter."""

AMPLITUDES_BEYOND = 30.0
"""Factor beyond the amplitudes of a stuck and a free cart within which roots are searched."""

MOST_DECADES = 8
"""Most decades searched. A law that needs more is unbounded."""

AMPLITUDES_PER_DECADE = 32  # [1/decade]
"""Amplitudes per decade. Fewer step over two roots that lie close together."""


@dataclass(frozen=True)
class DrivenPlant:
    """A plant at some frequencies [Hz], shape (frequencies,), without its friction.

    `compliances` [m/N], complex, shape (frequencies, 2, 2), are positions of stage and cart for forces on stage and
    cart. `flat` has the stage's keys in SI, among them the friction.
    """

    flat: Mapping[str, Any]
    frequencies: np.ndarray
    compliances: np.ndarray
    rtol: float

    @classmethod
    def of(cls, flat: Mapping[str, Any], frequencies: np.ndarray, rtol: float = IMPOSED_RTOL) -> DrivenPlant:
        """Return the plant of a stage whose limiter is not touched, at frequencies [Hz]."""
        (compliances,) = mechanics(flat, np.zeros(1, bool)).at(2j * np.pi * frequencies)
        return cls(flat, frequencies, compliances, rtol)

    def answer(self, amplitudes: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the forces [N] that move the cart by amplitudes [m], shape (count,).

        `which` numbers the frequencies. Also returns the positions of stage and cart over the forces [m/N], complex,
        (count, 2), and the dynamic stiffness of friction [N/m]. Results are NaN or infinite where friction was not
        found.
        """
        stiffness = dynamic_stiffness(self.flat, amplitudes, self.frequencies[which], self.rtol)
        compliances = self.compliances[which]
        with np.errstate(all="ignore"):  # failures give NaN or infinity, which is no root
            cart = compliances[:, 1, 0] / (1 + compliances[:, 1, 1] * stiffness)
            stage = compliances[:, 0, 0] - compliances[:, 0, 1] * stiffness * cart
            return amplitudes / np.abs(cart), np.stack([stage, cart], axis=1), stiffness

    @cached_property
    def stuck(self) -> float:
        """Return an amplitude [m] so small that bristles do not slip."""
        friction = Imposition.of(self.flat, np.ones(1), np.ones(1), self.rtol)
        return float(
            np.min(
                STUCK_AMPLITUDE * friction.scales[0, friction.inner],
                initial=STATELESS_AMPLITUDE if not friction.inner else 1,
            )
        )

    def ends(self, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return amplitudes [m] that need less force, and more, than some forces [N].

        Both have the shape (forces, frequencies). They lie well beyond the amplitudes of a stuck and of a free cart,
        and do not depend on other forces.
        """
        rows, shape = np.arange(len(self.frequencies)), (len(forces), len(self.frequencies))
        with np.errstate(over="ignore"):
            bare = np.clip(np.abs(self.compliances[:, 1, 0]) * forces[:, None], *AMPLITUDE_LIMITS)
        stuck = np.abs(self.answer(np.full(shape[1], self.stuck), rows)[1][:, 1])
        slid = np.abs(self.answer((FREE_AMPLITUDE * bare).ravel(), np.tile(rows, shape[0]))[1][:, 1]).reshape(shape)
        with np.errstate(over="ignore"):
            states = np.stack([bare, stuck * forces[:, None], slid * forces[:, None]])
        low, high = (
            np.fmin.reduce(states) / AMPLITUDES_BEYOND,
            np.fmax.reduce(states) * AMPLITUDES_BEYOND,
        )
        return self._extended(low, forces, -1), self._extended(high, forces, 1)

    def _extended(self, amplitudes: np.ndarray, forces: np.ndarray, side: int) -> np.ndarray:
        """Return amplitudes moved until they need less force (`side` -1) or more (1) than `forces`."""
        amplitudes = np.clip(amplitudes, *AMPLITUDE_LIMITS)
        force, frequency = (indices.ravel() for indices in np.indices(amplitudes.shape))
        for _ in range(MOST_DECADES):
            reached = self.answer(amplitudes[force, frequency], frequency)[0]
            missed = ~(side * (reached - forces[force]) > 0)
            force, frequency = force[missed], frequency[missed]
            if not force.size:
                break
            amplitudes[force, frequency] = np.clip(amplitudes[force, frequency] * 10.0**side, *AMPLITUDE_LIMITS)
        return amplitudes

    def grid(self, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return amplitudes [m] and the forces [N] that they need, both (frequencies, points).

        The third result, shape (forces, frequencies, points - 1), marks the cells of the grid in which an amplitude for
        a force is searched.
        """
        low, high = self.ends(forces)
        first = np.floor(AMPLITUDES_PER_DECADE * np.log10(low)).astype(int)
        last = np.ceil(AMPLITUDES_PER_DECADE * np.log10(high)).astype(int)
        points = int(np.max(last.max(axis=0) - first.min(axis=0))) + 1
        numbers = first.min(axis=0)[:, None] + np.arange(points)
        amplitudes = 10.0 ** (numbers / AMPLITUDES_PER_DECADE)
        pending = numbers <= last.max(axis=0)[:, None]
        reached = np.full(amplitudes.shape, np.nan)
        reached[pending], _, _ = self.answer(amplitudes[pending], np.nonzero(pending)[0])
        cells = numbers[None, :, :-1]
        return amplitudes, reached, (cells >= first[:, :, None]) & (cells < last[:, :, None])


@dataclass(frozen=True)
class Roots:
    """Amplitudes [m] of the cart in equilibrium with a force at a frequency, shape (count,).

    `force` and `frequency` are indices. `rising` is true if the force rises with the amplitude, and `error` is the
    remaining relative error. `unknown`, of shape (forces, frequencies), marks where friction was not found at an
    amplitude that may be a root.
    """

    force: np.ndarray
    frequency: np.ndarray
    amplitude: np.ndarray
    rising: np.ndarray
    error: np.ndarray
    unknown: np.ndarray


FORCE_ERROR = 1e-10
"""Relative error of the force at a root. Larger ones show in curves."""

MOST_ROOT_STEPS = 60
"""Most steps to a root; halving alone needs fewer."""


def driven_amplitudes(driven: DrivenPlant, forces: np.ndarray) -> Roots:
    """Find all amplitudes at which forces [N] move the cart, as far as the grid resolves."""
    amplitudes, reached, inside = driven.grid(forces)
    above = reached >= forces[:, None, None]
    computed = np.isfinite(reached[:, :-1] + reached[:, 1:])
    force, frequency, cell = np.nonzero((above[:, :, :-1] != above[:, :, 1:]) & inside & computed)
    root = find_root(
        lambda x, at, size: np.log(driven.answer(np.exp(x), at)[0] / size),
        tuple(np.log(amplitudes[frequency, cell + side]) for side in (0, 1)),
        args=(frequency, forces[force]),
        tolerances={"fatol": FORCE_ERROR},
        maxiter=MOST_ROOT_STEPS,
    )
    rising = reached[frequency, cell + 1] > reached[frequency, cell]
    return Roots(force, frequency, np.exp(root.x), rising, np.abs(root.f_x), np.any(inside & ~computed, axis=2))


NOT_FOUND = "no amplitude was found at which this force moves the cart"
MISSING = "answers are missing: friction was not found at some amplitude, or the least or greatest answer does not last"


@check_arguments
def plant_response(
    stage: Stage,
    forces: Sequence[float] | np.ndarray,
    frequencies: Sequence[float] | np.ndarray,
    rtol: float = IMPOSED_RTOL,
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
    >>> import friso, friso_thesis
    >>> friso_thesis.plant_response(friso.load("rig.toml"), [2.0], [5.0, 10.0])["up"]  # doctest: +SKIP
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
    unfound = (count == 0) | np.any(present & ~(branches["error"] <= 100 * FORCE_ERROR), axis=2)
    deflection = np.abs(branches["response"] - branches["cart_response"]) * forces[:, None, None]
    status = np.where(missing, MISSING, "done").astype(object)
    status[np.any(beyond_stroke(stage.flat(), deflection), axis=2)] = TOUCHES
    status[unfound] = NOT_FOUND
    return status.astype(str)


@check_arguments
def mass_line(
    stage: Stage,
    places: Sequence[Mapping[str, Any]],
    forces: Sequence[float] | np.ndarray,
    frequencies: Sequence[float] | np.ndarray,
    rtol: float = IMPOSED_RTOL,
) -> xr.Dataset:
    """Return how far the measured plant lies off the line 1/(m omega^2), place by place.

    The mass m is the whole mass of the plant. `places` lists what differs there, as keys of the stage file with their
    values, such as {"friction.static": "2 N"}. `forces` [N] and `frequencies` [Hz] are those of the measurement, and
    `rtol` is the tolerance of its friction. Variables over ("place", "force", "frequency"):

    - `ratio`: the response that an analyser shows, stepping up in frequency (see `plant_response`), over the line. It
      is complex, and 1 on the line.
    - `magnitude`: absolute value of the ratio.
    - `phase` [rad]: phase of the response over -180 degrees.

    The variables `spread_magnitude` and `spread_phase` over ("force", "frequency") are standard deviations over the
    places. Raises InputError for places that no stage may have, for a stage without friction, and for forces,
    frequencies or an `rtol` that are not usable.

    Examples
    --------
    >>> import friso, friso_thesis
    >>> places = [{"friction.static": "2 N"}, {"friction.static": "3 N"}]
    >>> friso_thesis.mass_line(friso.load("rig.toml"), places, [2.0], [5.0, 10.0])  # doctest: +SKIP
    """
    import xarray as xr

    flat = stage.flat()
    mass = flat.get("masses.cart", 0.0) + flat.get("masses.stage", 0.0)
    rows = [plant_response(stage.replace(place), forces, frequencies, rtol)["up"] for place in places]
    response = xr.concat(rows, "place")
    ratio = -response * mass * (2 * np.pi * response["frequency"]) ** 2
    magnitude = np.abs(ratio)
    phase = ratio.copy(data=np.angle(ratio.values))
    named = {
        "ratio": (ratio, "1", "response over mass line"),
        "magnitude": (magnitude, "1", "magnitude over mass line"),
        "phase": (phase, "rad", "phase over mass line"),
        "spread_magnitude": (magnitude.std("place", ddof=1), "1", "scatter of the magnitude"),
        "spread_phase": (phase.std("place", ddof=1), "rad", "scatter of the phase"),
    }
    variables = {name: array.assign_attrs(units=unit, long_name=text) for name, (array, unit, text) in named.items()}
    return xr.Dataset(variables, attrs={"stage": stage.to_toml(), "rtol": rtol})
