"""Replace a machine's controller by active disturbance rejection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from friso.equations.controllers.adrc import BANDWIDTH, OBSERVER_RATIO, crossing_ratio
from friso.equations.controllers.van_dijk import TUNED_MASS
from friso.errors import InputError
from friso.stage import ControllerSection, Stage
from friso.stage.controllers import CONTROLLER, KIND
from friso.stage.transmission import moving_mass

ADRC = "adrc"
"""Name of the option, and kind of the controller."""


class Rejection(NamedTuple):
    """Bandwidths of a disturbance-rejecting controller: of its feedback [Hz], of its observer.

    The observer's is a multiple of the feedback's.
    """

    bandwidth: float
    observer_ratio: float


def rejecting(stage: Stage, crossings: Sequence[float]) -> Stage:
    """Return the stage with active disturbance rejection as fast as its present controller.

    The loop of the sliding machine, with the mass for which it is tuned, crosses 0 dB at the lowest of the present
    `crossings` [Hz]. Force limit and filters are kept. Raises InputError if there is no crossing, or the drive is too
    slow.
    """
    if not crossings:
        raise InputError(CONTROLLER, "a loop that crosses 0 dB nowhere", "one that does", 'crossover = "8 Hz"')
    kept = {
        name: value
        for name, value in stage.as_written()[CONTROLLER].items()
        if name in ControllerSection.model_fields and name != "kind"
    }
    slow = stage.replace({CONTROLLER: {**kept, "kind": ADRC, "bandwidth": "1 mHz"}})
    flat = stage.flat()
    return slow.with_numbers(
        {
            BANDWIDTH: min(crossings) / crossing_ratio(slow.flat()[OBSERVER_RATIO]),
            TUNED_MASS: flat.get(TUNED_MASS, moving_mass(flat)),
        }
    )


def rejection(flat: Mapping[str, Any]) -> Rejection | None:
    """Return the bandwidths of a stage's disturbance-rejecting controller, None for another one."""
    return Rejection(flat[BANDWIDTH], flat[OBSERVER_RATIO]) if flat[KIND] == ADRC else None
