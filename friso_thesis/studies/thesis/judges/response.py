"""Judge Fig. 5: the response of the locked rig."""

from __future__ import annotations

import numpy as np

from friso.hunting.measures import BANDS
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, judges
from friso_thesis.studies.thesis.reading import reading


@judges("F5", figure="5", needs=("locked",))
def locked_rig_hunts(evidence: Evidence) -> Finding:
    """Judge whether peaks, period and amplitude of the locked rig are as in the thesis."""
    words = reading()
    cell = evidence.responses["locked"].cell
    peaks, period, amplitude = int(cell["count"]), float(cell["period"]), float(cell["peak_to_peak"]) / 2
    size = f"amplitude {amplitude * 1e3:.3g} mm" if amplitude > BANDS[0] else "no amplitude"
    return Finding(
        (
            Part(
                "at least one peak is counted after 10 s, as in every map",
                peaks >= 1,
                f"{peaks} peaks",
            ),
            Part(
                f"the period lies between {1 / words.order:.2g} s and 10 s",
                1 / words.order <= period <= 10,
                f"period {period:.3g} s" if np.isfinite(period) else "no period",
            ),
            Part(
                f"the amplitude (half of peak to peak) lies between {1 / words.order:.2g} and {words.order:.2g} mm",
                1e-3 / words.order <= amplitude <= 1e-3 * words.order,
                size,
            ),
        )
    )
