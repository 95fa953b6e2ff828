"""Doubt: a force depends on the position, such as a spring, a cable or cogging."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from friso.errors import InputError
from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.settings import doubt_settings


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Fit the inverse model with a separate force at each of several places along the way."""
    places = _places(case.log["position"], len(case.inverse.measured))
    with suppress(InputError):
        if places:
            model = case.modelled(case.log, extra=places)
            size = float(np.ptp([0.0, *(model.value(name) for name in places)]))
            words = f"a force that varies with position, by {size:.2g} {case.unit}, accounts for most of it"
            yield RaisedDoubt(words=words, size=size, unit=case.unit, without=model, spoils=True)


def _places(position: np.ndarray, rows: int) -> dict[str, np.ndarray]:
    """Return a triangular function of position, (n,), for each of several places, by name.

    A function is 1 at its place, and 0 from the neighbouring places on. The first place has none. The result is {} for
    a log with few `rows`.
    """
    count = min(doubt_settings.places_of_a_force, rows // doubt_settings.rows_for_each_place)
    if count < 3:
        return {}
    nodes = np.linspace(position.min(), position.max(), count)
    near = 1 - np.abs(position - nodes[:, None]) / (nodes[1] - nodes[0])
    return {f"place {i}": np.maximum(row, 0.0) for i, row in enumerate(near) if i}


DOUBT = Doubt(
    "cause",
    find,
    "the fit of the inverse model with a force that depends on position",
    "intervals reach to the values without it; friction at low speed is refused",
    "slow passes to and fro over the same way",
    after=("drifting-force",),
)
