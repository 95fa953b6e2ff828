"""Position steps with the cart fixed: stiffness of the joint.

Thesis, Sec. 4.2.2, Fig. 19. At rest the actuator only holds the joint, so differences of force over differences of
deflection are its stiffness, whatever the constant force. If the deflection is measured, this holds even while the cart
creeps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Any

import numpy as np

from friso.identification.estimate import Estimate, with_interval
from friso.identification.estimate_documents import estimates_document
from friso.identification.kind import AREA, TIME, AnalysisSettings, ExperimentKind, Facts, Prior, Source
from friso.identification.logs.checks import runs
from friso.identification.logs.log import Log
from friso.identification.readings.common import (
    BLOCKS_OF_A_MEAN,
    Mean,
    block_mean,
    by_segment,
    by_t,
    cart,
    channel,
    deflection,
    low_pass,
)
from friso.identification.readings.course import Course
from friso.identification.readings.friction_velocity import LINEARITY_OF_SENSORS
from friso.shown.documents import entries
from friso.shown.drawing.figure import BLUE, INK, Axis, Band, Figure, Markers, Panel, Series
from friso.stage import Stage

SETTLED_SHARES = np.linspace(0.1, 0.7, 7)
"""Fractions of a plateau after which it may have settled, tried in turn."""

KEY, UNIT = "joint.stiffness", "N/m"

SOFT = "more deflection does not need more force: is the cart fixed?"

METHOD = "differences of force over differences of deflection between settled position steps"


@dataclass(frozen=True)
class Window:
    """A settled window from `start` to `end` [s], with mean deflection [m] and force [N].

    `force_error` is the standard error of the force at that deflection by block means, including the remaining drift.
    """

    start: float
    end: float
    position: float
    force: float
    force_error: float


@dataclass(frozen=True)
class StepStiffness:
    """The stiffness [N/m] of a joint from position steps with the cart fixed.

    Stiffness is given for all steps, and for steps up and down. `hysteresis` [N] is the difference in force between a
    deflection reached from below and from above. Further fields are the settled `windows`, the low-passed force [N],
    shape (n,), and whether the cart was fixed (None: not measured).
    """

    stiffness: Estimate
    up: Estimate
    down: Estimate
    hysteresis: Estimate
    windows: tuple[Window, ...]
    time: np.ndarray
    position: np.ndarray
    force: np.ndarray
    cart_fixed: bool | None
    warnings: tuple[str, ...]


LOW_PASS_OF_STEPS = 25.0  # [Hz]
"""Low-pass of the force of position steps (thesis, Sec. 4.2.2)."""


def stiffness_from_steps(log: Log) -> StepStiffness:
    """Estimate the joint's stiffness from position steps with the cart fixed.

    The force is low-passed. Windows are the plateaus of the reference, or of the position without one. The stiffness
    is unknown without two steps between settled windows. Raises InputError for a log without position or force in SI
    units.
    """
    position, force = channel(log, "position"), channel(log, "force")
    measured = deflection(log)
    deflected = position if measured is None else measured
    cutoff = LOW_PASS_OF_STEPS
    smooth = [by_segment(log, values, low_pass, cutoff) for values in (force, deflected)]
    spans = [span for part in log.segments for span in _plateaus(log, part, cutoff)]
    scale, secant = _scale(position, spans), _secant(smooth[1], smooth[0], spans)
    settled = [_settled_window(log, span, smooth[0], smooth[1], scale, secant) for span in spans]
    windows = tuple(w for w in settled if w is not None)
    fixed, notes = _fixed(log, position, windows)
    warnings = list(notes)
    if len(windows) < len(spans):
        warnings.append(f"{len(spans) - len(windows)} of {len(spans)} plateaus had not settled and are left out.")
    steps = np.diff([[w.position, w.force] for w in windows], axis=0).reshape(-1, 2)
    noise = np.array([np.hypot(a.force_error, b.force_error) for a, b in pairwise(windows)])
    large = np.abs(steps[:, 0]) > 0.2 * scale
    whole, up, down = (
        _slope(steps, noise, large & chosen, words, len(spans))
        for chosen, words in ((steps[:, 0] != 0, ""), (steps[:, 0] > 0, ", upwards"), (steps[:, 0] < 0, ", downwards"))
    )
    curves = (log.time, deflected, smooth[0])
    return StepStiffness(whole, up, down, _hysteresis(windows), windows, *curves, fixed, tuple(warnings))


def _plateaus(log: Log, part: slice, cutoff: float) -> list[slice]:
    """Find stretches of a segment at a constant position that are long enough to average.

    The reference decides what is constant; without a reference, the position does, low-passed at `cutoff` [Hz]. `part`
    are the samples of the segment; a short one has no stretches.
    """
    least = int(np.ceil(4 / (cutoff * log.sample_time)))
    if part.stop - part.start < 2 * least:
        return []
    if "reference" in log:
        level = channel(log, "reference")[part]
        change = np.abs(np.diff(level, prepend=level[0]))
        steady = change <= 1e-3 * np.ptp(level)
    else:
        level = low_pass(channel(log, "position")[part], log.sample_time, cutoff)
        half = max(least // 4, 1)
        moved = np.abs(np.roll(level, -half) - np.roll(level, half))
        moved[:half] = moved[-half:] = 0.0
        steady = moved <= 0.02 * np.ptp(level)
    spans = [slice(part.start + s.start, part.start + s.stop) for s in runs(steady)]
    return [s for s in spans if s.stop - s.start >= least]


def _scale(position: np.ndarray, spans: list[slice]) -> float:
    """Return the usual size of the larger steps between plateaus `spans` [m]; 0 without steps.

    It is the median of all steps that are not small against the largest.
    """
    levels = np.array([np.median(position[s][(s.stop - s.start) // 2 :]) for s in spans])
    sizes = np.abs(np.diff(levels))
    return float(np.median(sizes[sizes >= 0.3 * sizes.max()])) if len(sizes) else 0.0


def _secant(position: np.ndarray, force: np.ndarray, spans: list[slice]) -> float:
    """Return a rough stiffness [N/m] from the later half of plateaus; 0 for fewer than two."""
    levels = np.array([[np.median(x[s][(s.stop - s.start) // 2 :]) for x in (position, force)] for s in spans])
    if len(levels) < 2 or not np.ptp(levels[:, 0]) > 0:
        return 0.0
    return float(np.polyfit(levels[:, 0], levels[:, 1], 1)[0])


DRIFT_OF_A_SETTLED_FORCE = 0.02
"""Largest drift of the force in a settled window beyond the deflection's share, relative to a step."""

DRIFT_OF_A_SETTLED_PLACE = 0.1
"""Largest drift of the deflection in a settled window if no window drifts less, relative to a step."""


def _settled_window(
    log: Log, span: slice, force: np.ndarray, position: np.ndarray, scale: float, secant: float
) -> Window | None:
    """Return the part of a plateau that has settled; None without one.

    In the settled part the deflection hardly drifts, and the force drifts no more than in proportion, apart from noise
    or a fraction of a step. `span` are the samples of the plateau, `scale` [m] is the usual step, and `secant` [N/m] a
    rough stiffness.
    """
    length = span.stop - span.start
    margin = min(length // 10, int(1 / (LOW_PASS_OF_STEPS * log.sample_time)))
    range_of_force = float(np.subtract(*np.percentile(force, [95, 5])))
    limits = DRIFT_OF_A_SETTLED_FORCE, DRIFT_OF_A_SETTLED_PLACE
    for allowed, share in product(limits, SETTLED_SHARES):
        chosen = slice(span.start + int(share * length), span.stop - margin)
        if chosen.stop - chosen.start < 2 * BLOCKS_OF_A_MEAN:
            continue
        bent, creep = _drifting(position[chosen])
        beyond, drift = _drifting(force[chosen] - secant * position[chosen])
        if creep <= allowed * scale and drift <= limits[0] * range_of_force:
            time = log.time[[chosen.start, chosen.stop - 1]]
            level = beyond.value + secant * bent.value
            return Window(time[0], time[1], bent.value, level, float(np.hypot(beyond.error, drift / 12**0.5)))
    return None


def _drifting(values: np.ndarray) -> tuple[Mean, float]:
    """Return the mean of a window, and its drift from beginning to end beyond the noise.

    The noise counts as four standard errors of the mean; the drift is 0 if it is smaller.
    """
    mean = block_mean(values)
    shift = values[len(values) // 2 :].mean() - values[: len(values) // 2].mean()
    return mean, float(max(abs(2 * shift) - 4 * mean.error, 0.0))


def _slope(steps: np.ndarray, noise: np.ndarray, chosen: np.ndarray, words: str, plateaus: int) -> Estimate:
    """Estimate the stiffness by a line through the origin: changes of force over deflection.

    `steps` has these changes, deflection in the first column; `noise` [N] is that of each change. Only `chosen` steps
    count, described by `words`; the stiffness is unknown with fewer than two. `plateaus` is mentioned in the reason.

    Neighbouring changes share a window, so the largest of three variances counts: for independent changes (drifting
    force), for changes of independent windows (noise), and by the noise within windows.
    """
    method = METHOD + words
    count = int(chosen.sum())
    if count < 2:
        steps_seen = "1 step" if count == 1 else f"{count} steps"
        reason = f"{steps_seen}{words} between settled windows ({plateaus} plateaus): 2 are needed"
        return Estimate.unknown(KEY, UNIT, method, reason)
    x, y = np.where(chosen, steps[:, 0], 0.0), np.where(chosen, steps[:, 1], 0.0)
    slope = float(x @ y / (x @ x))
    off = np.where(chosen, y - slope * x, 0.0)
    spread = float(off @ off) / (count - 1)
    shared = float(np.sum(np.diff(np.concatenate(([0.0], x, [0.0]))) ** 2)) / float(x @ x) / 2
    within = float(np.sum((x * noise) ** 2) / (x @ x) ** 2)
    variance = max(max(1.0, shared) * spread / float(x @ x), within)
    linear = LINEARITY_OF_SENSORS * abs(slope)
    return by_t(KEY, UNIT, Mean(slope, variance**0.5, count - 1), method, linear, linear).if_positive(SOFT)


def _hysteresis(windows: tuple[Window, ...]) -> Estimate:
    """Estimate hysteresis from forces at deflections reached from both sides.

    The fit is force = offset + stiffness * deflection + half the hysteresis * direction of the last step.
    """
    name, unit, method = "hysteresis", "N", "force at a deflection reached from below minus from above"
    x, force = np.array([[w.position, w.force] for w in windows]).reshape(-1, 2).T
    if len(x) < 5 or len(set(direction := np.sign(np.diff(x)))) < 2:
        return Estimate.unknown(name, unit, method, "no deflections reached from both sides, over 5 windows or more")
    x, force = x[1:], force[1:]
    design = np.stack([np.ones_like(x), (x - x.mean()) / np.ptp(x), direction / 2], axis=1)
    solution, rest, rank, _ = np.linalg.lstsq(design, force, rcond=1e-6)
    if rank < 3 or len(x) == 3:
        return Estimate.unknown(name, unit, method, "deflection and direction of the steps cannot be separated")
    variance = float(np.sum(rest)) / (len(x) - 3) * np.linalg.inv(design.T @ design)[2, 2]
    return by_t(name, unit, Mean(float(solution[2]), float(variance**0.5), len(x) - 3), method)


TRAVEL_OF_A_FIXED_CART = 0.02
"""Largest motion of a fixed cart, relative to the position's steps."""


def _fixed(log: Log, position: np.ndarray, windows: tuple[Window, ...]) -> tuple[bool | None, tuple[str, ...]]:
    """Tell whether the cart stood still between the windows, with notes.

    The first result is None if no channel shows the cart, or with fewer than two windows.
    """
    moved = cart(log)
    if moved is None:
        return None, ("The cart is assumed fixed: no channel shows whether it is.",)
    if len(windows) < 2:
        return None, ()
    marks = [slice(*np.searchsorted(log.time, (w.start, w.end))) for w in windows]
    followed, went = (np.ptp([x[m].mean() for m in marks]) for x in (moved, position))
    if followed <= TRAVEL_OF_A_FIXED_CART * went:
        return True, ()
    finding = f"The cart is not fixed: it moved by {followed:.3g} m while the stage moved by {went:.3g} m"
    return False, (f"{finding}; the deflection of the joint was measured nevertheless.",)


class StepsKind(ExperimentKind[StepStiffness]):
    """Position steps with the cart fixed, which show the stiffness of the joint."""

    title = "Position steps"

    def estimates(self, result: StepStiffness, stage: Stage | None) -> tuple[Estimate, ...]:
        """Return the estimate of the joint's stiffness; none for a stage without a joint."""
        return (replace(result.stiffness, name=KEY),) if stage is None or stage.joint else ()

    def claims(self, course: Course) -> str | None:
        """Return why a log holds position steps against a joint, or None.

        The position of such a log rests in several places, where the force rises with the position. No reference moves.
        """
        if course.reference_moves or not course.against_a_spring:
            return None
        return "the position rests here and there, and the force follows from the place, as against a spring"

    def facts(self, result: StepStiffness) -> Facts:
        """List the stiffness of all steps, up and down, and the hysteresis."""
        return (
            ("Joint stiffness", with_interval(result.stiffness)),
            ("Steps up", with_interval(result.up)),
            ("Steps down", with_interval(result.down)),
            ("Hysteresis", with_interval(result.hysteresis)),
            ("Settled windows", str(len(result.windows))),
        )

    def sentences(self, result: StepStiffness) -> tuple[str, ...]:
        """Say whether the cart moved; empty if that was not measured."""
        fixed = {True: "The cart stood still.", False: "The cart moved.", None: ""}[result.cart_fixed]
        return (fixed,) if fixed else ()

    def numbers(self, result: StepStiffness) -> dict[str, Any]:
        """Return the stiffness, and the times at rest from which it follows, for the document."""
        windows = [
            {
                **entries(window, "force_n"),
                "start_s": window.start,
                "end_s": window.end,
                "deflection_m": window.position,
            }
            for window in result.windows
        ]
        estimates = estimates_document(result, "stiffness", "up", "down", "hysteresis")
        return {**estimates, "windows": windows, **entries(result, "cart_fixed", "warnings")}

    def figures(self, result: StepStiffness, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw deflection and force over time with the settled windows, and force over deflection."""
        panels = []
        for quantity, unit, values in (("Deflection", "m", result.position), ("Force", "N", result.force)):
            low, high = float(values.min()), float(values.max())
            room = 0.06 * (high - low)
            bands = tuple(
                Band(
                    np.array([w.start, w.end]),
                    np.full(2, low - room),
                    np.full(2, high + room),
                    "settled" if i == 0 else "",
                    AREA,
                )
                for i, w in enumerate(result.windows)
            )
            line = Series(
                result.time, values, quantity.lower() + ("" if unit == "m" else ", low-passed"), INK, width=1.0
            )
            panels.append(Panel("", TIME, Axis(quantity, unit, (low - room, high + room)), (line,), bands=bands))
        caption = "Shaded: settled windows, of which the means are used."
        figures = [Figure(f"{name}_record", "Steps of the position", caption, tuple(panels))]
        if len(result.windows) < 2:
            return figures
        x, y = np.array([[w.position, w.force] for w in result.windows]).T
        lines = ()
        if result.stiffness.determined:
            ends = np.array([x.min(), x.max()])
            line = y.mean() + result.stiffness.value * (ends - x.mean())
            lines = (Series(ends, line, f"stiffness {with_interval(result.stiffness)}", BLUE),)
        points = Markers(x, y, "settled windows", INK)
        panel = Panel("", Axis("Deflection", "m"), Axis("Force", "N"), lines, (points,))
        caption = f"Means of the settled windows. Hysteresis: {with_interval(result.hysteresis)}."
        return [*figures, Figure(f"{name}_stiffness", "Force over deflection", caption, (panel,))]

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> StepStiffness:
        """Analyse a log of steps."""
        return stiffness_from_steps(log)


KIND = StepsKind()
