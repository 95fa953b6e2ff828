"""Compute the loops of a cascade separately, each opened where a drive's Bode plot opens it.

The plant leads from the commanded force to the velocity at the encoder. The velocity loop is cut where the velocity is
fed back, with the position loop open. The position loop is cut where the position is fed back, with the velocity loop
closed (Gross, Hamann, Wiegaertner 2001, Electrical Feed Drives, chapters 3 and 4). With loops at several rates both are
characteristic loci (`friso.frequency.rates`), which do not depend on the place of the cut.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from friso.frequency.drive import DriveTiming
from friso.frequency.loops import lifted_loop, poles, response
from friso.frequency.margins import Margins, margins_of
from friso.frequency.members import Members
from friso.frequency.parts import FORCE, STAGE, VELOCITY, plant
from friso.frequency.rates import locus_of
from friso.frequency.settings import settings
from friso.frequency.system import Complex
from friso.stage.controllers import controller_of

POSITION_TIME = "drive.position_sample_time"

CascadeLoop = Literal["velocity", "position"]


@dataclass(frozen=True)
class CascadeLoops:
    """Loops of a cascade in one state of the stage, complex, over `Bode.omega`.

    `plant` leads from the commanded force to the velocity [m/(N s)], with hold, delay and current loop. `loops` are the
    "velocity" and the "position" loop, with their `margins`.
    """

    plant: np.ndarray
    loops: Mapping[CascadeLoop, np.ndarray]
    margins: Mapping[CascadeLoop, Margins]


def is_cascade(flat: Mapping[str, Any]) -> bool:
    """Tell whether the controller of a stage has a velocity loop within its position loop."""
    return controller_of(flat).feeds_back == "velocity"


def cascade_loops(flat: Mapping[str, Any], member: Members, omega: np.ndarray) -> CascadeLoops:
    """Return the loops of a cascade in one state of the stage, over angular frequencies [rad/s]."""
    drive = DriveTiming.of(flat)
    moved = plant(flat, member).take((FORCE,), (VELOCITY,)).at(1j * omega)[0, :, 0, 0]
    alone = {key: value for key, value in flat.items() if key != POSITION_TIME}  # open the position loop
    timing = DriveTiming.of(alone)
    inner, outer = response(alone, member, timing, cut=STAGE), _position_loop(flat, member, drive)
    of_inner = poles(alone, member, timing, cut=STAGE)
    closed, continuous = of_inner.closed[:, _seen(of_inner.in_s)], of_inner.continuous[:, _seen(of_inner.continuous)]
    of_inner = replace(of_inner, closed=closed, continuous=continuous)
    return CascadeLoops(
        plant=moved * drive.transfer(omega),
        loops={"velocity": inner(omega), "position": outer(omega)},
        margins={
            "velocity": margins_of(inner, alone, member, of_inner),
            "position": margins_of(outer, flat, member, poles(flat, member, drive)),
        },
    )


def _seen(rates: Complex) -> np.ndarray:
    """Return which poles of a velocity loop its feedback can move, shape (n,).

    `rates` are the poles [rad/s], shape (1, n).
    """
    sizes = np.abs(rates[0])
    return sizes > settings.unseen_pole * sizes[np.isfinite(sizes)].max(initial=0.0)


def _position_loop(flat: Mapping[str, Any], member: Members, drive: DriveTiming) -> Callable[[np.ndarray], Complex]:
    """Return the position loop as a function of angular frequencies [rad/s].

    The velocity loop within it is closed.
    """
    if not drive.sample_time:
        outer, inner = (response(flat, member, drive, cut=channel) for channel in (VELOCITY, STAGE))
        return lambda omega: outer(omega) / (1 + inner(omega))
    by_position, by_velocity = (lifted_loop(flat, member, drive, cut=channel) for channel in (VELOCITY, STAGE))

    def at(omega: np.ndarray) -> Complex:
        turn = omega * drive.sample_time
        inner = by_velocity.over(turn)
        matrices = np.linalg.solve(np.eye(inner.shape[-1]) + inner, by_position.over(turn))
        return locus_of(matrices.astype(complex), turn)[0]

    return at
