"""Stages beyond the flip of their symmetric cycle that hunt all the same, in an asymmetric one."""

from variants import VARIANTS

CREEPING = VARIANTS["rigid"].replace(
    {
        "masses": {"cart": "2.6276 kg", "stage": "0.07984 kg"},
        "friction": {
            "model": "lugre",
            "static": "28.54 N",
            "coulomb": "17.928 N",
            "stribeck_velocity": "9.8268 mm/s",
            "stribeck_exponent": 2,
            "bristle_stiffness": "347410 N/m",
            "bristle_damping": "610.7 N*s/m",
            "viscous": "1.0802 N*s/m",
        },
        "controller": {"kind": "pid", "crossover": "12.3332 Hz", "alpha": 0.186, "beta": 3.62},
    }
)
"""Beyond the flip of its symmetric cycle, but with an asymmetric one that is never left; small distances creep home."""

LIGHT = VARIANTS["rigid"].replace(
    {"masses": {"cart": "1 g", "stage": "0.5 g"}, "controller.crossover": "34.45 Hz", "controller.tuned_mass": "1.5 g"}
)
"""Of a gram and a half, beyond the flip of its symmetric cycle."""
