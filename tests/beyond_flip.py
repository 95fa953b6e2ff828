"""Stages beyond the flip of their symmetric cycle that hunt all the same, in an asymmetric one, or
irregularly."""

from variants import VARIANTS

from friso.stage import Stage

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
"""A stage of a gram and a half, beyond the flip of its symmetric cycle."""

STEEP = Stage(
    masses={"cart": "0.148062 kg", "stage": "0.0299594 kg"},
    friction={
        "model": "lugre",
        "static": "0.00879014 N",
        "coulomb": "0.00411367 N",
        "stribeck_velocity": "0.000402154 m/s",
        "stribeck_exponent": 2.0,
        "viscous": "0.00276236 N*s/m",
        "bristle_stiffness": "33464.9 N/m",
        "bristle_damping": "82.0815 N*s/m",
    },
    controller={
        "kind": "pid",
        "kp": "937.148 N/m",
        "ki": "3852.91 N/(m*s)",
        "kd": "23.6007 N*s/m",
        "derivative_on": "measurement",
    },
    motion={"kind": "release", "duration": "20 s", "displacement": "0.00128738 m"},
)
"""A stage whose symmetric cycle flips at 0.135 of its bandwidth. The return map turns steeply 3 % beside the cycle, and
keeps irregular swings beyond the flip."""
