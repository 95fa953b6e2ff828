"""friso: friction-induced hunting of positioning stages, and the friction isolator that stops it."""

import friso.platform.early  # noqa: F401 (notes a signal that comes while the rest is imported)

# isort: split
import importlib
from importlib.machinery import PathFinder
from typing import TYPE_CHECKING, Any

from friso.version import VERSION as __version__

if TYPE_CHECKING:
    from friso.errors import InputError, LogError, SpecError, StageError, StoreError
    from friso.frequency.loops import linear
    from friso.frequency.margins import Tuning, tuning
    from friso.frequency.system import Members, member
    from friso.interface.starting import example, init, schema
    from friso.questions.bode.question import bode
    from friso.questions.boundary.question import boundary
    from friso.questions.check.question import check
    from friso.questions.compare.question import compare
    from friso.questions.design.question import design
    from friso.questions.doctor.question import doctor
    from friso.questions.export.question import export
    from friso.questions.flexure.question import flexure
    from friso.questions.identify.question import identify
    from friso.questions.logs.question import logs
    from friso.questions.map.question import sweep
    from friso.questions.simulate.question import simulate
    from friso.questions.tune.question import tune
    from friso.stage import Stage, load, loads, save
    from friso.studies.axes import Samples
    from friso.studies.store import read_store

_PLACES = {
    "friso.interface.starting": ("example", "init", "schema"),
    "friso.errors": ("InputError", "LogError", "SpecError", "StageError", "StoreError"),
    "friso.frequency.loops": ("linear",),
    "friso.frequency.system": ("Members", "member"),
    "friso.frequency.margins": ("Tuning", "tuning"),
    "friso.stage": ("Stage", "load", "loads", "save"),
    "friso.studies.axes": ("Samples",),
    "friso.studies.store": ("read_store",),
}
"""Where everything public stands that is no function of a question."""

_LAZY = {name: module for module, names in _PLACES.items() for name in names}

__all__ = [
    "InputError",
    "LogError",
    "Members",
    "Samples",
    "SpecError",
    "Stage",
    "StageError",
    "StoreError",
    "Tuning",
    "__version__",
    "bode",
    "boundary",
    "check",
    "compare",
    "design",
    "doctor",
    "example",
    "export",
    "flexure",
    "identify",
    "init",
    "linear",
    "load",
    "loads",
    "logs",
    "member",
    "read_store",
    "save",
    "schema",
    "simulate",
    "sweep",
    "tune",
    "tuning",
]


def __getattr__(name: str) -> Any:
    """Import a name when it is first used: numbers with units and arrays take half a second.

    Functions of questions, of friso and of installed packages, are found where these are declared.
    """
    if name in _LAZY:
        return getattr(importlib.import_module(_LAZY[name]), name)
    nearest = ""
    if not name.startswith("_") and PathFinder.find_spec(f"friso.{name}", __path__) is None:
        from difflib import get_close_matches

        from friso.errors import InputError
        from friso.interface.question import function_of

        try:
            return function_of(name)
        except InputError as error:
            raise AttributeError(str(error)) from error
        except KeyError:
            nearest = "".join(f"; did you mean {near!r}?" for near in get_close_matches(name, __dir__(), 1))
    raise AttributeError(f"module 'friso' has no attribute {name!r}{nearest}")


def __dir__() -> list[str]:
    """What is public, for completion, with the functions of installed packages."""
    from friso.interface.question import QUESTIONS

    return [*__all__, *(name.replace("-", "_") for name in QUESTIONS.others)]
