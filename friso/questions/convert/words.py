"""Describe a conversion to another friction law in words.

The sentences say what is kept, what is not, and what measurements leave open.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.interface.answer import AnswerTable
from friso.quantities import percent
from friso.shown.documents import entries, plain_json
from friso.shown.drawing.prefixes import listed, with_unit
from friso.stage.stage import declared_keys

if TYPE_CHECKING:
    from friso.studies.laws.conversion import LawConversion, MeasuredChange, MeasuredKind

SHOWN: Mapping[MeasuredKind, str] = {
    "curve": "steady friction over speed",
    "static": "break-away",
    "stiffness": "stiffness before sliding",
    "virgin": "virgin curve",
    "conditions": "the conditions of the stage",
    "damping": "damping at rest",
    "viscous": "viscous damping",
    "loop area": "energy lost in a loop",
    "loop stiffness": "stiffness of a loop",
}
"""Names of the properties of friction that measurements show."""

COLUMNS = ("before", "after", "off by", "kept")
"""Columns of the table that compares both laws."""


def sentences(conversion: LawConversion) -> list[str]:
    """Say what could not be kept, then what stays open, and whether the law is passive."""
    law, lost = conversion.law, conversion.lost
    name = conversion.stage.name or "the stage"
    if lost:
        says = [f"{name} under {law}: {listed([_change(item) for item in lost], 'and')}."]
    else:
        says = [f"{name} under {law} fits the same measurements."]
    if not any(item.amplitude for item in conversion.compared):
        says.append("Hysteresis loops were not compared: nothing shows them of what was measured.")
    if conversion.points:
        says.append(_stiffness(conversion.points.stiffness, conversion.before.stiffness))
    says += [_open(key, ends, conversion) for key, ends in conversion.open.items()]
    return [*says, *activity_sentences(conversion.active)]


def _stiffness(ends: tuple[float, float], stiffness: float) -> str:
    """Say which stiffness before sliding measured points allow, from `ends` [N/m].

    `stiffness` [N/m] is the value taken.
    """
    low, high, value = (with_unit(x, "N/m") for x in (*ends, stiffness))
    if np.isinf(ends[1]):
        return (
            f"The points do not show the stiffness before sliding, which is taken as {value}: too few lie close to "
            "rest. Measure closer to rest, and see that displacement 0 is where the force begins."
        )
    between = f"between {low} and {high}" if ends[0] else f"up to {high}"
    return (
        f"The points show a stiffness before sliding {between}, if displacement 0 is where the force begins; "
        f"it is taken as {value}."
    )


def activity_sentences(condition: str) -> list[str]:
    """Say that a law may give energy back, with the `condition` under which it is passive.

    An empty condition means that the law is passive, and nothing is said.
    """
    return [f"The law may give energy back, which no friction does. It is passive where {condition}."] * bool(condition)


def quantity_name(item: MeasuredChange) -> str:
    """Name a measured quantity; a hysteresis loop is named with its amplitude."""
    amplitude = "" if item.amplitude is None else f" of ±{with_unit(item.amplitude, 'm')}"
    return f"{SHOWN[item.kind]}{amplitude}"


def _change(item: MeasuredChange) -> str:
    """Say by how much a measured effect changes in the conversion."""
    before, after = (with_unit(value, item.unit) for value in (item.before, item.after))
    return f"{quantity_name(item)} is not kept ({before} becomes {after})"


def _open(key: str, ends: tuple[float, float], conversion: LawConversion) -> str:
    """Say between which values the measurements leave a key open."""
    flat = conversion.stage.flat()
    unit = getattr(declared_keys(flat)[key], "unit", "")
    low, high, value = (with_unit(x, unit) if unit else f"{x:.3g}" for x in (*ends, flat[key]))
    return f"The measurements leave {key} open between {low} and {high}; it is {value}."


def conversion_rows(conversion: LawConversion) -> list[tuple[str, list[str]]]:
    """Return the rows of the table: before, after, difference, and whether it is kept."""
    return [
        (
            quantity_name(item),
            [
                with_unit(item.before, item.unit),
                with_unit(item.after, item.unit),
                f"{percent(item.off)}",
                "yes" if item.kept else "no",
            ],
        )
        for item in conversion.compared
    ]


def blocks(conversion: LawConversion) -> list[str]:
    """Return the table [friction] of the new stage file."""
    text = conversion.stage.to_toml()
    begin = text.index("[friction]")
    end = text.find("\n[", begin + 1)
    return [text[begin : end if end > 0 else None].strip()]


SUFFIXES = {"N": "n", "N/m": "n_per_m", "N*s/m": "n_s_per_m", "J": "j"}
"""Suffixes of keys, by unit."""


def convert_document(conversion: LawConversion) -> dict[str, Any]:
    """Return what is kept, what is not, what stays open, and the keys of the new law."""
    flat = conversion.stage.flat()
    return plain_json(
        {
            "conclusion": " ".join(sentences(conversion)),
            "stage": conversion.stage.name,
            "law": conversion.law,
            "friction": {key.removeprefix("friction."): v for key, v in flat.items() if key.startswith("friction.")},
            "compared": [
                {
                    "what": SHOWN[item.kind],
                    "amplitude_m": item.amplitude,
                    f"before_{SUFFIXES[item.unit]}": item.before,
                    f"after_{SUFFIXES[item.unit]}": item.after,
                    **entries(item, "off", "kept"),
                }
                for item in conversion.compared
            ],
            "open": conversion.open,
            "stiffness_range_n_per_m": [*conversion.points.stiffness] if conversion.points else None,
            "scatter_n": conversion.points.scatter if conversion.points else None,
            "passive": not conversion.active,
            "passive_where": conversion.active or None,
        }
    )


def tables(conversion: LawConversion) -> list[AnswerTable]:
    """Return a table of what measurements show of both laws."""
    return [AnswerTable(conversion.stage.name, COLUMNS, conversion_rows(conversion))]
