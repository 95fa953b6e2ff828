"""Say on which unknown values an answer rests."""

from __future__ import annotations

from collections.abc import Collection

from friso.shown.drawing.prefixes import listed, with_unit
from friso.stage import Stage


def unknown_condition(stage: Stage | None, varied: Collection[str] = ()) -> str:
    """Write the condition under which an answer holds, with a colon and a blank behind it.

    The values are those that the stage file lists as unknown, or the centres of their ranges, except for the keys that
    are `varied`. Returns "" if there are none.
    """
    unknown = [] if stage is None else [key for key in stage.unknown_keys if key not in varied]
    if stage is None or not unknown:
        return ""
    flat, keys = stage.flat(), stage.numeric_keys()
    values = {key: with_unit(flat[key], keys[key].unit) for key in unknown if key in keys and key in flat}
    texts = [f"{key} is {values.get(key, 'as written')}" for key in unknown]
    return f"If {listed(texts, 'and')}, which the stage file lists as unknown: "


def if_so(stage: Stage) -> str:
    """Return ", if so" for a stage with unknown values, to stand behind the name of a case; "" for another."""
    return ", if so" if stage.assumed_keys else ""
