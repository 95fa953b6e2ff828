"""A closed loop as friction sees it: by how much cart and stage move for a friction force on the cart."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from friso.frequency.parts import compensator, mechanics


def receptance(flat: Mapping[str, Any], frequencies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions of cart and stage per friction force on the cart [m/N], complex, shape (frequencies,), of a loop whose
    reference rests, whose limiter is not touched and whose force is not limited, at frequencies [Hz].

    Without friction x = H (u, -F), and the controller answers with u = K x_s to the position of the stage.
    """
    s = 2j * np.pi * frequencies
    (masses,) = mechanics(flat, np.zeros(1, bool)).at(s)
    (control,) = compensator(flat, 1).at(s)
    gain = control[:, 0, 1] + s * control[:, 0, 2]
    stage = -masses[:, 0, 1] / (1 - masses[:, 0, 0] * gain)
    return masses[:, 1, 0] * gain * stage - masses[:, 1, 1], stage
