"""Choose the estimates that the keys of a stage file can take: within their bounds, and consistent with each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.output_error.settings import settings
from friso.identification.settings import identification_settings
from friso.identification.stage_file import estimate_text, identified_stage
from friso.intervals import uncertain_value
from friso.quantities import Number, Quantity
from friso.stage import Stage
from friso.stage.stage import numeric_keys

STATIC, COULOMB = "friction.static", "friction.coulomb"

ADDED = ("bias.cart", "bias.stage", "friction.viscous_asymmetry")
"""Keys that identification may add to a stage file."""


@dataclass(frozen=True)
class Fitting:
    """Estimates that the stage file can take together.

    `follows` has keys that change with another key (full correlation), and `notes` a sentence for each estimate that
    was changed or dropped. The keys `left` keep their values in the stage file, although logs should have shown them.
    """

    estimates: tuple[Estimate, ...]
    follows: Mapping[str, str]
    notes: tuple[str, ...]
    left: tuple[str, ...] = ()


def fitting(stage: Stage, estimates: Sequence[Estimate]) -> Fitting:
    """Choose the estimates that the stage file can take, one per key, in its units."""
    flat, notes = stage.flat(), []
    estimates = [replace(estimate, unit=stage.axis_kind.unit(estimate.unit)) for estimate in estimates]
    fields = numeric_keys({**flat, "bias.cart": 0.0})
    accepted: dict[str, Estimate] = {}
    for estimate in estimates:
        field = fields.get(estimate.name) if estimate.name in (*flat, *ADDED) else None
        if field is None:
            notes += [f"{estimate.name}: the stage has no such key, it is left out"] if estimate.determined else []
            continue
        bounded = _bounded(estimate, stage, estimates)
        accepted_estimate, why = _within(bounded, field)
        if not why and bounded.high < estimate.high:
            why = f"the upper end {bounded.high:.4g} {estimate.unit} is from what was known beforehand"
        notes += [f"{estimate.name}: {why}"] if why else []
        if accepted_estimate is not None:
            accepted[estimate.name] = accepted_estimate
    follows = _static_above(stage, fields, accepted, notes)
    together = _together(stage, accepted, notes)
    left = tuple(name for name in flat if name in {estimate.name for estimate in estimates} - accepted.keys())
    return Fitting(together, {k: v for k, v in follows.items() if k in accepted}, tuple(notes), left)


def shared_masses(total: Estimate, stage: Stage) -> tuple[Estimate, ...]:
    """Divide the total mass among the stage's masses in the stage file's proportion."""
    masses = {f"masses.{name}": value for name, value in stage.masses if value is not None}
    method = f"{total.method}, shared as in the stage file"
    shares = {key: value / sum(masses.values()) for key, value in masses.items()}
    return tuple(replace(total.scaled(share), name=key, unit="kg", method=method) for key, share in shares.items())


def _bounded(estimate: Estimate, stage: Stage, estimates: Sequence[Estimate]) -> Estimate:
    """Narrow an estimate without a value to the range that the stage file states.

    If static friction has only a lower bound, above the stage's value and Coulomb friction, the highest plausible ratio
    to Coulomb friction bounds it from above. Coulomb friction is taken from the `estimates`, or else from the stage.
    """
    before = stage.uncertain().get(estimate.name)
    if before is not None and not estimate.determined and before.high >= estimate.low and before.low <= estimate.high:
        estimate = replace(estimate, low=max(estimate.low, before.low), high=min(estimate.high, before.high))
    if estimate.name != STATIC or not np.isfinite(estimate.low) or np.isfinite(estimate.high):
        return estimate
    flat = stage.flat()
    coulomb = next((candidate for candidate in estimates if candidate.name == COULOMB and candidate.determined), None)
    value, high = (coulomb.value, coulomb.high) if coulomb else (flat[COULOMB], flat[COULOMB])
    top = settings.highest_friction_ratio * value
    # a bound equal to Coulomb friction adds nothing: static friction then follows Coulomb friction
    return replace(estimate, high=top) if max(flat[STATIC], high) < estimate.low < top else estimate


def _within(estimate: Estimate, field: Quantity | Number) -> tuple[Estimate | None, str]:
    """Restrict an estimate to the limits of its key; return it, or None if that is impossible.

    The second result is the reason for a change, or "". The estimate must have finite ends.
    """
    if not np.isfinite([estimate.low, estimate.high]).all():
        ends = [f"{word} {end:.4g} {estimate.unit}".rstrip() for word, end in _ends(estimate)]
        knowledge = f"known only to be {' and '.join(ends)}"
        return None, knowledge if ends else ""
    if not estimate.high > estimate.low:
        return None, "its uncertainty is not known, the stage file keeps its value"
    if not (field.bound.holds(estimate.low) or field.bound.holds(estimate.high)):
        ends = f"{estimate.low:.4g} to {estimate.high:.4g} {estimate.unit}".rstrip()
        return None, f"{ends} is all that is known, the stage file keeps its value: it has to be {field.bound.text}"
    if _allowed(estimate, field):
        return estimate, ""
    low = identification_settings.share_of_a_least_value * estimate.high
    cut = replace(estimate, value=np.nan, low=low, reason=estimate.reason or f"it has to be {field.bound.text}")
    limits = f"{estimate_text(estimate)} was found, but it has to be {field.bound.text}"
    if estimate.low < low and _allowed(cut, field):
        return cut, f"{limits}: the stage file has {estimate_text(cut)}, from a thousandth of the upper end on"
    return None, f"{limits}: the stage file keeps its value"


def _ends(estimate: Estimate) -> list[tuple[str, float]]:
    """List the finite ends of an estimate's interval, each as ("at least" or "at most", value)."""
    return [(word, end) for word, end in (("at least", estimate.low), ("at most", estimate.high)) if np.isfinite(end)]


def _allowed(estimate: Estimate, field: Quantity | Number) -> bool:
    """Tell whether the key accepts the estimate as written in a stage file."""
    try:
        uncertain_value(estimate_text(estimate), field)
    except InputError:
        return False
    return True


def _static_above(
    stage: Stage, fields: Mapping[str, Quantity | Number], estimates: dict[str, Estimate], notes: list[str]
) -> dict[str, str]:
    """Change `estimates` so that static friction is no smaller than Coulomb friction.

    A range of static friction is cut from below. Otherwise static friction follows an estimate of Coulomb friction, or
    else Coulomb friction follows static friction, in the stage's ratio. Returns which key follows which, {} if neither
    does; `notes` get a sentence on each change.
    """
    flat = stage.flat()
    if STATIC not in flat or not estimates.keys() & {STATIC, COULOMB}:
        return {}
    centre = {
        key: float(uncertain_value(estimate_text(estimates[key]), fields[key]) if key in estimates else flat[key])
        for key in (STATIC, COULOMB)
    }
    if centre[STATIC] >= centre[COULOMB]:
        return {}
    static = estimates.get(STATIC)
    if static is not None and not static.determined and centre[COULOMB] < static.high:
        estimates[STATIC] = replace(static, low=centre[COULOMB])
        now = estimate_text(estimates[STATIC])
        notes.append(f"{STATIC}: no smaller than Coulomb friction, the stage file has {now}")
        return {}
    leads, follows = (COULOMB, STATIC) if COULOMB in estimates else (STATIC, COULOMB)
    ratio, lead = flat[follows] / flat[leads], estimates[leads]
    remark = f" ({estimate_text(estimates[follows])} was found)" if follows in estimates else ""
    estimates[follows] = replace(lead.scaled(ratio), name=follows)
    why = f"Coulomb friction would be above static friction otherwise{remark}"
    notes.append(f"{follows}: moved along with {leads} to {estimate_text(estimates[follows])}, since {why}")
    return {follows: leads}


def _together(stage: Stage, estimates: dict[str, Estimate], notes: list[str]) -> tuple[Estimate, ...]:
    """Return the estimates with which the stage file is valid.

    A key that breaks a rule of the stage file is removed from `estimates`, and `notes` say so.
    """
    units = [[key for key in (COULOMB, STATIC) if key in estimates]]
    units += [[key] for key in estimates if key not in (COULOMB, STATIC)]
    fine: list[Estimate] = []
    for unit in units:
        try:
            identified_stage(stage, [*fine, *(estimates[key] for key in unit)], ())
        except InputError as error:
            for key in unit:
                del estimates[key]
            notes.append(f"{', '.join(unit)}: left out, since the stage file takes {error.expected}")
            continue
        fine += [estimates[key] for key in unit]
    return tuple(fine)
