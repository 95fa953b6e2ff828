"""Stages whose controllers leave friso in tests: five controllers on three machines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import friso
from friso.stage import Stage

EXAMPLES = Path(__file__).parents[1] / "examples"

_DRIVE = {"sample_time": "125 us", "delay": "150 us", "encoder_resolution": "5 nm", "encoder_noise": "1 nm"}

CONTROLLERS: dict[str, dict[str, Any]] = {
    "van_dijk_notch": {
        "controller": {
            "kind": "pid",
            "crossover": "8 Hz",
            "alpha": 0.1,
            "beta": 2,
            "force_limit": "100 N",
            "filters": [{"kind": "notch", "frequency": "300 Hz", "width": "100 Hz", "depth": 0.9}],
        },
        "drive": _DRIVE,
    },
    "cascade": {
        "controller": {
            "kind": "cascade",
            "kv": "25 1/s",
            "kp": "90 N*s/m",
            "velocity_integral_time": "40 ms",
            "velocity_feedforward": 1.0,
            "acceleration_feedforward": "1.7 kg",
            "coulomb_feedforward": "0.5 N",
            "integral_limit": "2 N",
            "force_limit": "150 N",
            "anti_windup": "back_calculation",
            "anti_windup_time": "20 ms",
        },
        "drive": {**_DRIVE, "position_sample_time": "500 us"},
    },
    "adrc": {
        "controller": {"kind": "adrc", "bandwidth": "8 Hz", "observer_ratio": 5, "force_limit": "100 N"},
        "drive": _DRIVE,
    },
    "transfer_function": {
        "controller": {
            "kind": "transfer_function",
            "numerator": [2e3, 8e4, 4e5],
            "denominator": [1.0, 400.0, 0.0],
            "force_limit": "60 N",
        },
        "drive": {**_DRIVE, "feedforward_mass": "1.7 kg"},
    },
    "scheduled": {
        "controller": {
            "kind": "pid",
            "crossover": "9 Hz",
            "alpha": 0.1,
            "beta": 2,
            "force_limit": "120 N",
            "schedule_error": ["5 um", "50 um"],
            "schedule_factor": [0.5, 1],
            "error_deadband": "1 um",
            "error_deadband_exit": "3 um",
            "error_deadband_time": "2 ms",
            "integral_rests_in_moves": True,
            "freeze_window": "0.5 um",
            "freeze_window_exit": "5 um",
            "freeze_window_time": "5 ms",
            "standstill_window": "20 um",
            "standstill_factor": 0.8,
        },
        "drive": _DRIVE,
    },
}
MACHINES = {"rigid_lugre": "lugre_stick_slip", "isolator": "thesis_rig", "gms": "thesis_rig_gms"}


def stage_of(controller: str, machine: str) -> Stage:
    """Return a stage of these two, with the move of the thesis."""
    stage = friso.load(EXAMPLES / f"{MACHINES[machine]}.toml")
    motion = friso.load(EXAMPLES / "thesis_rig.toml").as_written()["motion"]
    tables = {**stage.as_written(), "motion": motion, **CONTROLLERS[controller]}
    return Stage(**tables)
