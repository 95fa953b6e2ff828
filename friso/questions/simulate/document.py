"""Build the JSON document of `friso simulate`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from friso.hunting.criteria import OUTCOME_CRITERION
from friso.hunting.measures import Measures
from friso.shown.documents import dwells_document, plain_json

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from friso.hunting import Dwell


def simulate_document(
    response: xr.Dataset, measures: Measures, name: str, conclusion: str, dwells: Sequence[Dwell]
) -> dict[str, Any]:
    """Return the JSON document of a run: what it does, and how the solver fared.

    `name` is the name of the stage.
    """
    into_1um, into_10um = measures.settling_time
    return plain_json(
        {
            "conclusion": conclusion,
            "stage": name,
            "outcome": measures.outcome[0],
            "criterion": OUTCOME_CRITERION,
            "peak_to_peak_m": measures.peak_to_peak[0],
            "period_s": measures.period[0],
            "settling_time_s": into_1um[0],
            "settling_time_10um_s": into_10um[0],
            **({"dwells": dwells_document(dwells)} if dwells else {}),
            "solver": {key: response.attrs[key] for key in ("status", "steps", "rejected", "rtol")},
        }
    )
