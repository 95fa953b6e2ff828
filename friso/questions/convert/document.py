"""Build the JSON document of `friso convert`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from friso.questions.convert.words import SHOWN, sentences
from friso.shown.documents import entries, plain_json

if TYPE_CHECKING:
    from friso.studies.laws.conversion import LawConversion

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
