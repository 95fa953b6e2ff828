"""Write the laws of the guideline as formulas, and its numbers as text."""

from __future__ import annotations

import math
from collections.abc import Sequence

from friso.quantities import percent
from friso.shown.text import listed
from friso_thesis.studies.guideline.compute import Guideline
from friso_thesis.studies.guideline.groups import GROUPS
from friso_thesis.studies.guideline.laws import REFERENCE, FittedLaw
from friso_thesis.studies.guideline.worked import ParasiticLimits, ThesisCase

BASES = {
    "slip": "sigma_0 v_s/F_s",
    "drop": "(F_s - F_c)/(m v_s)",
    "joint": "sqrt(k_j/m)",
    "stroke": "sqrt(F_s/(m S_j))",
}
"""Formula of each rate [rad/s], without its factor and fitted powers."""


ONE_RULE_RATIO = 2.0
"""Largest ratio between multiples of the crossover that still make one rule."""


def formulas(guideline: Guideline) -> str:
    """Return both laws as formulas for use by hand, line by line."""
    locked, free = guideline.locked.law, guideline.free.law
    lines = [
        *_rates(locked),
        "omega_locked = 1/(1/omega_slip + 1/omega_drop)",
        "",
        *_rates(free),
        "omega_free   = 1/sqrt(1/omega_locked^2 + 1/max(omega_joint, omega_stroke)^2)",
    ]
    return "\n".join(lines)


def _rates(law: FittedLaw) -> list[str]:
    return [
        f"{f'omega_{rate.name}':<12} = {number(law.factors[place])} {BASES[rate.name]}"
        + "".join(
            f"  {_power(group, value)}"
            for group, value in sorted(law.of(place).items(), key=lambda item: [*GROUPS].index(item[0]))
        )
        for place, rate in enumerate(law.law.rates)
    ]


def _power(group: str, exponent: float) -> str:
    """Write a dimensionless group, divided by its reference value, to a power, as text."""
    written, reference = GROUPS[group].written, REFERENCE[group]
    base = f"({written})" if reference == 1 else f"({written}/{reference:g})"
    if group == "gap":
        base = "gap"
    return f"{base}^{exponent:.2f}"


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with `digits` digits; a dash for NaN."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e6 else f"{value:.{digits}g}"


def log_error(off: float) -> str:
    """Write an error of a natural logarithm in percent of the number: 0.1 is "11 %"."""
    return f"{percent(math.expm1(off))}"


def accuracy(guideline: Guideline) -> list[str]:
    """Say how well each law predicts the edge of hunting of stages that it was not fitted to."""
    fits = (("locked", guideline.locked.on_test), ("free", guideline.free.on_test))
    return [
        f"The law for the {case} joint predicts the edge of hunting of {errors.count} stages that it was not fitted to "
        f"with an RMS error of {log_error(errors.rms)}, {log_error(errors.worst)} at worst."
        for case, errors in fits
    ]


def parasitic_edges(cases: Sequence[ThesisCase]) -> str:
    """Say how far the parasitic mode moves the edge of hunting."""
    edges = [case.computed for case in cases if math.isfinite(case.computed)]
    if not edges:
        return "No edge is known with any of these modes."
    spread = max(edges) / min(edges) - 1
    return f"Over these modes the edge differs by at most {percent(spread)}."


def parasitic_sentences(modes: Sequence[ParasiticLimits]) -> list[str]:
    """Say which crossovers leave enough margin beside parasitic modes, joint locked, then free.

    There is one sentence for each state of the joint and damping ratio of the mode. If crossovers differ much between
    modes, the last sentence says that no multiple of the crossover is a rule for all.
    """
    ratios = [mode.frequency / end[1] for mode in modes for end in (mode.locked, mode.free) if end]
    conclusion = "Actuator and sensor are on the same part here."
    if ratios and max(ratios) > ONE_RULE_RATIO * min(ratios):
        conclusion = (
            f"At the upper end of a range the mode is {_spread(ratios)} times the crossover: no single multiple of the "
            f"crossover is a rule for all modes. {conclusion}"
        )
    dampings = dict.fromkeys(mode.damping_ratio for mode in modes)
    return [*(_ranges(state, damping, modes) for state in ("locked", "free") for damping in dampings), conclusion]


def _ranges(state: str, damping: float, modes: Sequence[ParasiticLimits]) -> str:
    """Say between which crossovers the margin is enough, over all modes with one damping ratio.

    `state` is "locked" or "free", the state of the joint.
    """
    ends = {mode.frequency: getattr(mode, state) for mode in modes if mode.damping_ratio == damping}
    usable = {frequency: end for frequency, end in ends.items() if end}
    without = [f"{frequency:g}" for frequency, end in ends.items() if not end]
    subject = f"Joint {state}, damping ratio {damping:g}"
    if not usable:
        return f"{subject}: none of these modes leaves a range that contains the rig's crossover."
    low, high = (_spread([end[place] for end in usable.values()]) for place in (0, 1))
    ratio = _spread([frequency / end[1] for frequency, end in usable.items()])
    without_range = f" With a mode at {listed(without, 'or')} Hz there is no range that contains the rig's crossover."
    return (
        f"{subject}: the range begins at {low} Hz and ends at {high} Hz, where the mode is {ratio} times as high."
        f"{without_range if without else ''}"
    )


def _spread(values: Sequence[float]) -> str:
    low, high = number(min(values)), number(max(values))
    return low if low == high else f"{low} to {high}"


def sentences(guideline: Guideline) -> list[str]:
    """Say how accurately both laws predict the edge of hunting of held-out stages.

    Of an interrupted guideline it is said first on how many samples it rests.
    """
    so_far = f"Interrupted: the answer so far, from {guideline.samples} samples of the locked law."
    return [*([so_far] if guideline.interrupted else []), *accuracy(guideline)]
