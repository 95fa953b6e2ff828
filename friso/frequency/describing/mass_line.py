"""Compute the mass line of a plant with friction at several places (thesis, Fig. 17)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.frequency.describing.response import plant_response
from friso.frequency.describing.steady import RTOL
from friso.stage import Stage
from friso.stage.arguments import check_arguments

if TYPE_CHECKING:
    import xarray as xr


@check_arguments
def mass_line(
    stage: Stage,
    places: Sequence[Mapping[str, Any]],
    forces: Sequence[float] | np.ndarray,
    frequencies: Sequence[float] | np.ndarray,
    rtol: float = RTOL,
) -> xr.Dataset:
    """Return how far the measured plant lies off the line 1/(m omega^2), place by place.

    The mass m is the whole mass of the plant. `places` lists what differs there, as keys of the stage file with their
    values, such as {"friction.static": "2 N"}. `forces` [N] and `frequencies` [Hz] are those of the measurement, and
    `rtol` is the tolerance of its friction. Variables over ("place", "force", "frequency"):

    - `ratio`: the response that an analyser shows, stepping up in frequency (see `plant_response`), over the line. It
      is complex, and 1 on the line.
    - `magnitude`: absolute value of the ratio.
    - `phase` [rad]: phase of the response over -180 degrees.

    The variables `spread_magnitude` and `spread_phase` over ("force", "frequency") are standard deviations over the
    places. Raises InputError for places that no stage may have, for a stage without friction, and for forces,
    frequencies or an `rtol` that are not usable.

    Examples
    --------
    >>> import friso
    >>> places = [{"friction.static": "2 N"}, {"friction.static": "3 N"}]
    >>> friso.mass_line(friso.load("rig.toml"), places, [2.0], [5.0, 10.0])  # doctest: +SKIP
    """
    import xarray as xr

    flat = stage.flat()
    mass = flat.get("masses.cart", 0.0) + flat.get("masses.stage", 0.0)
    rows = [plant_response(stage.replace(place), forces, frequencies, rtol)["up"] for place in places]
    response = xr.concat(rows, "place")
    ratio = -response * mass * (2 * np.pi * response["frequency"]) ** 2
    magnitude = np.abs(ratio)
    phase = ratio.copy(data=np.angle(ratio.values))
    named = {
        "ratio": (ratio, "1", "response over mass line"),
        "magnitude": (magnitude, "1", "magnitude over mass line"),
        "phase": (phase, "rad", "phase over mass line"),
        "spread_magnitude": (magnitude.std("place", ddof=1), "1", "scatter of the magnitude"),
        "spread_phase": (phase.std("place", ddof=1), "rad", "scatter of the phase"),
    }
    variables = {name: array.assign_attrs(units=unit, long_name=text) for name, (array, unit, text) in named.items()}
    return xr.Dataset(variables, attrs={"stage": stage.to_toml(), "rtol": rtol})
