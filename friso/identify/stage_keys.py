"""Which estimates the keys of a stage file can take: each within its bound, and all of them together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from friso.errors import InputError
from friso.identify.estimate import Estimate
from friso.identify.output_error.parameters import HIGHEST_RATIO
from friso.identify.stage_file import identified, written
from friso.intervals import uncertain_value
from friso.quantities import Number, Quantity
from friso.stage import Stage
from friso.stage.stage import numeric_keys

LEAST = 1e-3
"""Share of a range's upper end at which one begins that would hold 0 or less, where a key does not allow that: smaller
values make no difference beside it, and a range over orders of magnitude needs an end."""

STATIC, COULOMB = "friction.static", "friction.coulomb"

ADDED = ("bias.cart", "bias.stage", "friction.viscous_asymmetry")
"""Keys that a stage file may get though it had none."""


@dataclass(frozen=True)
class Fitting:
    """Estimates that can all stand in the stage file, keys that move along with another (full correlation), and a
    sentence for each that cannot stand there as it was found."""

    kept: tuple[Estimate, ...]
    follows: Mapping[str, str]
    said: tuple[str, ...]


def fitting(stage: Stage, found: Sequence[Estimate]) -> Fitting:
    """What of the estimates, one per key, the stage file can take."""
    flat, said = stage.flat(), []
    fields = numeric_keys({**flat, "bias.cart": 0.0})
    kept: dict[str, Estimate] = {}
    for each in found:
        field = fields.get(each.name) if each.name in (*flat, *ADDED) else None
        if field is None:
            said += [f"{each.name}: the stage has no such key, it is left out"] if each.shown else []
            continue
        known = _bounded(each, stage, found)
        one, why = _within(known, field)
        if not why and known.high < each.high:
            why = f"the upper end {known.high:.4g} {each.unit} is from what was known beforehand"
        said += [f"{each.name}: {why}"] if why else []
        if one is not None:
            kept[each.name] = one
    follows = _static_above(stage, fields, kept, said)
    return Fitting(_together(stage, kept, said), {k: v for k, v in follows.items() if k in kept}, tuple(said))


def shared_masses(total: Estimate, stage: Stage) -> tuple[Estimate, ...]:
    """The whole mass, shared among the masses as in the stage."""
    given = {f"masses.{name}": value for name, value in stage.masses if value is not None}
    method, sizes = f"{total.method}, shared as in the stage file", ("value", "low", "high", "systematic")
    shares = {key: value / sum(given.values()) for key, value in given.items()}
    return tuple(
        replace(total, name=key, unit="kg", method=method, **{size: getattr(total, size) * share for size in sizes})
        for key, share in shares.items()
    )


def _bounded(each: Estimate, stage: Stage, found: Sequence[Estimate]) -> Estimate:
    """An estimate of which one bound is known, with the other one from what was known beforehand.

    Static friction known as "at least" reaches up to `HIGHEST_RATIO` times Coulomb friction, the most that is believed
    of a bearing, unless the stage knows.
    """
    before = stage.uncertain().get(each.name)
    if before is not None and not each.shown and before.high >= each.low and before.low <= each.high:
        each = replace(each, low=max(each.low, before.low), high=min(each.high, before.high))
    if each.name != STATIC or not np.isfinite(each.low) or np.isfinite(each.high):
        return each
    flat = stage.flat()
    coulomb = next((one for one in found if one.name == COULOMB and one.shown), None)
    value, high = (coulomb.value, coulomb.high) if coulomb else (flat[COULOMB], flat[COULOMB])
    top = HIGHEST_RATIO * value
    # a bound that is Coulomb friction itself tells nothing: static friction then moves along with that
    return replace(each, high=top) if max(flat[STATIC], high) < each.low < top else each


def _within(each: Estimate, field: Quantity | Number) -> tuple[Estimate | None, str]:
    """The estimate as far as the key allows it, or None; and why it is not as it was, if it is not."""
    if not np.isfinite([each.low, each.high]).all():
        known = [f"{word} {end:.4g} {each.unit}".rstrip() for word, end in _ends(each)]
        what = f"no more is known than that it is {' and '.join(known)}" if known else "nothing is known of it"
        return None, f"{what}, the stage file keeps what it had"
    if not each.high > each.low:
        return None, "its uncertainty is not known, the stage file keeps what it had"
    if not (field.bound.holds(each.low) or field.bound.holds(each.high)):
        known = f"{each.low:.4g} to {each.high:.4g} {each.unit}".rstrip()
        return None, f"{known} is all that is known, the stage file keeps what it had: it has to be {field.bound.text}"
    if _allowed(each, field):
        return each, ""
    low = LEAST * each.high
    cut = replace(each, value=np.nan, low=low, reason=each.reason or f"it has to be {field.bound.text}")
    limits = f"{written(each)} was found, but it has to be {field.bound.text}"
    if each.low < low and _allowed(cut, field):
        return cut, f"{limits}: the stage file has {written(cut)}, from a thousandth of the upper end on"
    return None, f"{limits}: the stage file keeps what it had"


def _ends(each: Estimate) -> list[tuple[str, float]]:
    """The ends that are known, in words."""
    return [(word, end) for word, end in (("at least", each.low), ("at most", each.high)) if np.isfinite(end)]


def _allowed(each: Estimate, field: Quantity | Number) -> bool:
    """Whether the key takes the text of the estimate."""
    try:
        uncertain_value(written(each), field)
    except InputError:
        return False
    return True


def _static_above(
    stage: Stage, fields: Mapping[str, Quantity | Number], kept: dict[str, Estimate], said: list[str]
) -> dict[str, str]:
    """Keep static friction no smaller than Coulomb friction: the one that is known less gives way, in `kept`; which
    moves along with the other, in the ratio that the stage had."""
    flat = stage.flat()
    if STATIC not in flat or not kept.keys() & {STATIC, COULOMB}:
        return {}
    centre = {key: float(_centre(kept[key], fields[key]) if key in kept else flat[key]) for key in (STATIC, COULOMB)}
    if centre[STATIC] >= centre[COULOMB]:
        return {}
    static = kept.get(STATIC)
    if static is not None and not static.shown and centre[COULOMB] < static.high:
        kept[STATIC] = replace(static, low=centre[COULOMB])
        said.append(f"{STATIC}: no smaller than Coulomb friction, the stage file has {written(kept[STATIC])}")
        return {}
    leads, follows = (COULOMB, STATIC) if COULOMB in kept else (STATIC, COULOMB)
    ratio, lead = flat[follows] / flat[leads], kept[leads]
    lost = f" ({written(kept[follows])} was found)" if follows in kept else ""
    kept[follows] = replace(lead, name=follows, value=lead.value * ratio, low=lead.low * ratio, high=lead.high * ratio)
    why = f"Coulomb friction would be above static friction otherwise{lost}"
    said.append(f"{follows}: moved along with {leads} to {written(kept[follows])}, since {why}")
    return {follows: leads}


def _centre(each: Estimate, field: Quantity | Number) -> float:
    return uncertain_value(written(each), field)


def _together(stage: Stage, kept: dict[str, Estimate], said: list[str]) -> tuple[Estimate, ...]:
    """Those with which the stage is one; a key that breaks a rule of the stage file is taken out of `kept`."""
    units = [[key for key in (COULOMB, STATIC) if key in kept]]
    units += [[key] for key in kept if key not in (COULOMB, STATIC)]
    fine: list[Estimate] = []
    for unit in units:
        try:
            identified(stage, [*fine, *(kept[key] for key in unit)], ())
        except InputError as error:
            for key in unit:
                del kept[key]
            said.append(f"{', '.join(unit)}: left out, since the stage file takes {error.expected}")
            continue
        fine += [kept[key] for key in unit]
    return tuple(fine)
