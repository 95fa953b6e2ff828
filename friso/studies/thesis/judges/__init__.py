"""The judges of the claims, by figure; importing a module registers those in it.

A judge of a later claim is one more module here (or a function decorated with `judges` anywhere): the page lists
its finding without a change.
"""

from friso.studies.thesis.judges import (
    arguments,
    control_and_friction,
    crossover,
    design_rules,
    identified_in_time,
    identified_responses,
    leaf_springs,
    limit_cases,
    loops,
    masses,
    path_and_system,
    response,
    rig_hunting,
    series_stiffness,
    shares,
    solver,
    stiffness_and_damping,
)

__all__ = [
    "arguments",
    "control_and_friction",
    "crossover",
    "design_rules",
    "identified_in_time",
    "identified_responses",
    "leaf_springs",
    "limit_cases",
    "loops",
    "masses",
    "path_and_system",
    "response",
    "rig_hunting",
    "series_stiffness",
    "shares",
    "solver",
    "stiffness_and_damping",
]
