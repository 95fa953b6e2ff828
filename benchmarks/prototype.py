"""Run the feasibility prototype `../shared/prototype/lanes.py`, if present.

It is never copied here.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

FILE = Path(__file__).parents[2] / "shared" / "prototype" / "lanes.py"


def load() -> ModuleType | None:
    """Return the prototype, compiled; None, with a note, if it is absent."""
    if not FILE.exists():
        print(f"  skipped: the prototype, {FILE} is absent")
        return None
    spec = importlib.util.spec_from_file_location("friso_prototype", FILE)
    if spec is None or spec.loader is None:
        return None
    module = importlib.util.module_from_spec(spec)
    writing, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = writing
    module.sweep([module.parameters()], T=0.1)
    return module


def run(module: ModuleType, rows: np.ndarray, rtol: float) -> tuple[np.ndarray, Any]:
    """Run rows of parameters.

    Returns steps (attempted, accepted), and the first run's maxima (times [s], heights [m]).
    """
    n = len(rows)
    times, heights, counts = np.zeros((n, 2000)), np.zeros((n, 2000)), np.zeros(n, np.int64)
    steps = module.run_all(rows, 20.0, rtol, rtol * 1e-2, 0.05, 128, times, heights, counts)
    return steps.sum(0), (times[0, : counts[0]], heights[0, : counts[0]])
