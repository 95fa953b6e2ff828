"""Say on which unknown values an answer rests."""

from __future__ import annotations

from collections.abc import Collection

from friso.shown.drawing.prefixes import listed, with_unit
from friso.stage import Stage
from friso.stage.contacts import followed


def unknown_condition(stage: Stage | None, varied: Collection[str] = ()) -> str:
    """Write the condition under which an answer holds, with a colon and a blank behind it.

    The values are those that the stage file lists as unknown, or the centres of their ranges, except for the keys that
    are `varied`; what follows one of these is said to do so. Returns "" if there are none.
    """
    unknown = [] if stage is None else [key for key in stage.unknown_keys if key not in varied]
    if stage is None or not unknown:
        return ""
    flat, keys = stage.flat(), stage.numeric_keys()
    values = {key: with_unit(flat[key], keys[key].unit) for key in unknown if key in keys and key in flat}
    leads = followed(stage, dict.fromkeys(varied, 1.0))
    texts = [f"{key} is {values.get(key, 'as written')}" for key in unknown if key not in leads]
    for lead in dict.fromkeys(lead for lead, _ in leads.values()):
        keys_of = [key for key in unknown if key in leads and leads[key][0] == lead]
        texts.append(f"{listed(keys_of, 'and')} follow{'s' * (len(keys_of) == 1)} {lead}")
    return f"If {listed(texts, 'and')}, which the stage file lists as unknown: "


def if_so(stage: Stage) -> str:
    """Return ", if so" for a stage with unknown values, to stand behind the name of a case; "" for another."""
    return ", if so" if stage.assumed_keys else ""
