"""friso: friction-induced hunting of positioning stages, and the friction isolator that stops it."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import friso.interrupts  # isort: skip  (first: what follows takes a while)
import friso.equations.controllers  # registers the controllers with the stage file
import friso.equations.friction  # and the friction laws
import friso.leaf_springs.joint  # noqa: F401 (and what follows from leaf springs)
from friso.errors import InputError, LogError, SpecError, StageError, StoreError
from friso.stage import Stage, load, loads, save
from friso.version import VERSION as __version__

if TYPE_CHECKING:
    from friso.cure.sensitivities import Sensitivities, sensitivity
    from friso.engine.simulate import simulate
    from friso.frequency.analysis import linear
    from friso.frequency.bode import Bode, bode
    from friso.frequency.describing.function import describing
    from friso.frequency.describing.mass_line import mass_line
    from friso.frequency.describing.response import plant_response
    from friso.frequency.members import Members, member
    from friso.frequency.tuning import Tuning, tuning
    from friso.hunting.check import Case, check
    from friso.studies.boundary import boundary
    from friso.studies.guideline.compute import guideline
    from friso.studies.harmonic_balance import harmonic_balance
    from friso.studies.samples import Samples
    from friso.studies.store import read_store
    from friso.studies.sweep import sweep

_LAZY = {
    "simulate": "friso.engine.simulate",
    "check": "friso.hunting.check",
    "Case": "friso.hunting.check",
    "sweep": "friso.studies.sweep",
    "bode": "friso.frequency.bode",
    "Bode": "friso.frequency.bode",
    "describing": "friso.frequency.describing.function",
    "guideline": "friso.studies.guideline.compute",
    "harmonic_balance": "friso.studies.harmonic_balance",
    "linear": "friso.frequency.analysis",
    "mass_line": "friso.frequency.describing.mass_line",
    "member": "friso.frequency.members",
    "Members": "friso.frequency.members",
    "plant_response": "friso.frequency.describing.response",
    "sensitivity": "friso.cure.sensitivities",
    "Sensitivities": "friso.cure.sensitivities",
    "tuning": "friso.frequency.tuning",
    "Tuning": "friso.frequency.tuning",
    "boundary": "friso.studies.boundary",
    "Samples": "friso.studies.samples",
    "read_store": "friso.studies.store",
}

__all__ = [
    "Bode",
    "Case",
    "InputError",
    "LogError",
    "Members",
    "Samples",
    "Sensitivities",
    "SpecError",
    "Stage",
    "StageError",
    "StoreError",
    "Tuning",
    "__version__",
    "bode",
    "boundary",
    "check",
    "describing",
    "guideline",
    "harmonic_balance",
    "linear",
    "load",
    "loads",
    "mass_line",
    "member",
    "plant_response",
    "read_store",
    "save",
    "sensitivity",
    "simulate",
    "sweep",
    "tuning",
]


def __getattr__(name: str) -> Any:
    """The numerical functions are imported when first used: xarray and what runs stages take half a second."""
    if name not in _LAZY:
        raise AttributeError(f"module 'friso' has no attribute {name!r}")
    return getattr(import_module(_LAZY[name]), name)
