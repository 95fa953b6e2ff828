"""Build the JSON document of `friso export`."""

from __future__ import annotations

from typing import Any

from friso.drives.gains import Gains
from friso.questions.export.words import notes
from friso.shown.documents import entries, plain_json


def export_document(gains: Gains) -> dict[str, Any]:
    """Return the gains of a stage in all units, and the parameters of a drive.

    Without a kind of drive, parameters and firmware are None.
    """
    return plain_json(
        {
            "stage": gains.stage.name,
            "structure": gains.diagram.splitlines(),
            "gains": [
                {
                    **entries(row, "name", "symbol"),
                    "values": [{"value": value, "unit": unit} for value, unit in row.values],
                }
                for row in gains.conversions
            ],
            "firmware": gains.kind.firmware if gains.kind else None,
            "parameters": None if gains.parameters is None else dict(gains.parameters),
            "notes": notes(gains),
        }
    )
