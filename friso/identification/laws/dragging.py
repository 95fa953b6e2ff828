"""Represent a log as a body dragged along the measured motion, and compute a law's friction on this body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.driven import Inputs, run_driven
from friso.engine.kernel import kernel
from friso.equations.dragged import Dragged
from friso.identification.laws.settings import settings
from friso.identification.logs.log import Log
from friso.identification.readings.at_bearing import Between, LowPass, at_bearing, cutoff_of, record_of, why_unseen
from friso.stage.tables import friction_law


@dataclass(frozen=True)
class DraggedRecord:
    """A log as a body dragged along the measured motion.

    Over `time` [s] the record has the position [m] of the body on the bearing, shape (n,). Force [N], after the drive's
    delay, and acceleration [m/s^2] of the whole moving mass are low-passed, and left out at the ends: shape (m,).
    """

    name: str
    position: np.ndarray
    low_pass: LowPass
    force: np.ndarray
    acceleration: np.ndarray

    @property
    def interval(self) -> float:
        """Return the time between samples [s]."""
        return float(self.low_pass.time[1] - self.low_pass.time[0])

    def friction(self, flat: Mapping[str, Any], runs: int) -> np.ndarray:
        """Return the low-passed friction force [N] of several laws along the record, (runs, m).

        The laws are of one kind, and differ in their numbers: `flat` has their keys with numbers or arrays of shape
        (runs,). Failed runs are NaN. The bristles start unbent.
        """
        law = flat["friction.model"]
        first = {key: value[0] if np.ndim(value) else value for key, value in flat.items()}
        shape = kernel(Dragged(law, friction_law(law).variant(first)))
        inputs = Inputs(self.position, np.zeros(len(self.position)), self.interval)
        starts = np.zeros((runs, shape.initial_size))
        starts[:, shape.position] = self.position[0]
        starts[:, shape.velocity] = inputs.velocity[0]  # a record may begin in motion
        forces = np.full((runs, len(self.force)), np.nan)
        timed = {**flat, "motion.duration": 1.0}
        for part in run_driven(shape, timed, runs, inputs, starts, settings.tolerance_of_dragging):
            impulse = part.states[:, :, -1]
            mean = np.diff(impulse, axis=1) / self.interval
            middle = np.pad((mean[:, 1:] + mean[:, :-1]) / 2, ((0, 0), (1, 1)), mode="edge")
            done = np.isfinite(middle).all(axis=1)
            forces[part.numbers[done]] = [self.low_pass(row) for row in middle[done]]
        return forces


def dragged_record(log: Log, between: Between) -> DraggedRecord | str:
    """Read the longest stretch of a log, or return why it cannot be read.

    Raises InputError for missing channels.
    """
    whole = record_of(log, log.longest, between)
    if why := why_unseen(whole, settings.samples_of_a_dragged_record):
        return why
    cutoff = cutoff_of(whole)
    every = max(int(1 / (settings.samples_of_a_dragged_period * cutoff * whole.interval)), 1)
    record = whole.seen(settings.band_of_the_motion * cutoff, every).beginning(settings.most_samples_of_a_record)
    low_pass = LowPass(record.time, cutoff)
    body, force, acceleration = at_bearing(record, between, between.mass)
    return DraggedRecord(log.name, body, low_pass, low_pass(force), low_pass(acceleration))


def blocks(records: Sequence[DraggedRecord], pieces: int) -> list[list[np.ndarray]]:
    """Divide the records into the parts that are left out of a fit in turn.

    Each part is a list with one mask of shape (m,) per record. With at least `pieces` records, each record is a part;
    otherwise each is cut into equally many pieces in time.
    """
    cuts = -(-pieces // len(records))
    parts = []
    for out in records:
        piece = np.arange(len(out.force)) * cuts // len(out.force)
        parts += [[(piece == k) if r is out else np.zeros(len(r.force), bool) for r in records] for k in range(cuts)]
    return parts
