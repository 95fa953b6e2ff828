"""The experiments by name, as `friso rig` takes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType

from friso.errors import InputError
from friso.stage import Stage
from friso.studies.rig.outcome import Outcome, Progress

EXPERIMENTS: Mapping[str, str] = MappingProxyType(
    {
        "frf": "frequency responses of the plant, locked at ten places and free; open loops over the crossover",
        "stiffness": "stiffness of the joint by position steps, the cart fixed",
        "stiction": "static friction by stick-slip in slow motion",
        "presliding": "stiffness and damping of the bearing's bristles by small motion before it slides",
        "constant-speed": "force at constant speed along the rail",
        "hunting": "a move at several crossovers, the joint locked and free",
        "stroke-crossover": "which share of rails hunts, over stroke and crossover",
        "compare": "hunting cycles as irregular and as slow as measured: how much friction has to vary for that",
        "in-position": "standstill with the joint locked and free",
    }
)


def experiment(name: str) -> Callable[[Stage, int, Progress], Outcome]:
    """The function that runs an experiment on a stage with a seed. Raises InputError for an unknown name."""
    if name not in EXPERIMENTS:
        raise InputError("EXPERIMENT", name, f"one of {', '.join(EXPERIMENTS)}", "friso rig stiffness rig.toml")
    return import_module(f"friso.studies.rig.{name.replace('-', '_')}").run_experiment
