"""Find the bandwidth from which a controller alone brings random machines to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.bandwidth import bandwidth, faster
from friso.equations.structure import shared_structure
from friso.frequency.bandwidth import bandwidths_at
from friso.frequency.crossover import limits
from friso.hunting.criteria import settling_in_the_end
from friso.stage import Stage
from friso.stage.controllers import as_tuned
from friso.stage.rig import AS_BUILT
from friso.studies.compare.machines import Machines
from friso.studies.compare.options import linear_flat
from friso.studies.settings import settings


@dataclass(frozen=True)
class NeededBandwidth:
    """Fractions of drawn machines that come to rest in the end by the controller alone, over bandwidth.

    `bandwidths` [Hz], shape (n,), are the last 0 dB crossings of the stage's own open loop, with ever faster
    controllers. They run from the present one to the highest that keeps enough margin. `shares`, shape (n,), are the
    fractions, and `factors`, shape (n,), say how much faster the controllers are. The joint is locked, and the
    controller in continuous time.
    """

    bandwidths: np.ndarray
    shares: np.ndarray
    factors: np.ndarray

    def turning(self, enough: float) -> int | None:
        """Return the index of the bandwidth from which on enough machines come to rest.

        `enough` is the fraction of machines that counts as enough. Returns None if the fraction at the highest
        bandwidth is smaller.
        """
        missed = np.flatnonzero(self.shares < enough)
        first = int(missed[-1]) + 1 if missed.size else 0
        return first if first < len(self.shares) else None


@np.errstate(all="ignore")  # runs that fail leave infinities behind
def needed_bandwidth(machines: Machines, locked: Stage, within: float) -> NeededBandwidth | None:
    """Run moves of some machines at many bandwidths, and count those that come to rest.

    The joint is `locked` in the stage, and rest means `within` [m] of the reference. Returns None if no higher
    bandwidth keeps the margin.
    """
    tried, count = settings.needed_bandwidths, min(machines.count, settings.needed_machines)
    ideal = locked.replace({table: None for table in AS_BUILT if getattr(locked, table)})
    flat = ideal.flat()
    highest, own = limits(linear_flat(locked, locked.flat())).highest_comfortable, bandwidth(flat) or 1.0
    if highest is None or highest <= own:
        return None
    factors = np.geomspace(1.0, highest / own, tried)
    drawn = {key: np.tile(values[:count], tried) for key, values in machines.keys.items() if key in flat}
    every = faster(ideal.flat({**as_tuned(flat), **drawn}), np.repeat(factors, count))
    rests = np.zeros(tried * count, bool)
    options = RunOptions(rtol=settings.needed_rtol, bands=(within, within), record_from=np.inf)
    for runs in run_chunks(kernel(shared_structure(every)), every, len(rests), options):
        done = np.equal(runs.results.statuses, Status.DONE)
        rests[runs.numbers] = done & np.isfinite(settling_in_the_end(runs.part(every), runs, "inner"))
    return NeededBandwidth(bandwidths_at(ideal, factors), rests.reshape(tried, count).mean(axis=1), factors)
