"""Logs as text files, in the format that every log reader knows: one column per signal, its unit in the heading."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

UNITS = {"force": "N", "disturbance": "N", "velocity": "m/s", "cart_velocity": "m/s"}
"""Units of the signals that are no lengths."""


def write_csv(path: Path, interval: float, signals: Mapping[str, np.ndarray], heading: str) -> None:
    """Signals of shape (n,) by role, every `interval` [s], below a line of comment (OSError where that is
    impossible). Twelve digits: a nanometre in a kilometre."""
    names = ["time [s]", *(f"{role} [{UNITS.get(role, 'm')}]" for role in signals)]
    count = len(next(iter(signals.values())))
    columns = np.column_stack([np.arange(count) * interval, *signals.values()])
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"# {heading}\n{','.join(names)}\n")
        np.savetxt(file, columns, fmt="%.12g", delimiter=",")
