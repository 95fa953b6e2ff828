"""The thesis's rig with its drive as built, and its loops and plants as they would be measured (Sec. 4.2.1, 4.2.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.stage import Stage
from friso.studies.rig.excitation import excite
from friso.studies.rig.frf import SETTINGS, Loop, apparent_masses, measured_loop, open_loops, stable_settings
from friso.studies.rig.outcome import rig_log
from friso.studies.rig.sizes import freed, locked, pace, travel
from friso.studies.thesis.rig_hunting import AS_BUILT, SEED


@dataclass(frozen=True)
class RigLoops:
    """Open loops locked at several settings, and free at the lowest of these; settings [Hz] tried free, shape (n,),
    and which were stable; apparent masses [kg], shape (2, ratios), locked and free, for the motor constants RATIOS."""

    locked: tuple[Loop, ...]
    free: Loop
    settings: np.ndarray
    stable: np.ndarray
    apparent: np.ndarray


def rig_loops(stage: Stage) -> RigLoops:
    """The loops of a rig with its drive as built."""
    built = stage.replace(dict(AS_BUILT))
    fixed, free, place = locked(built), freed(built), travel(built)[0]
    log = rig_log(excite(free, place, SEED), 0, "free", "frequency", free, SEED)
    settings, stable = stable_settings(free, place, SEED)
    apparent = np.array([apparent_masses(machine, place, SEED) for machine in (fixed, free)])
    _, loops = open_loops(fixed, place, SEED, SETTINGS)
    return RigLoops(loops, measured_loop(log, pace(built)), settings, stable, apparent)
