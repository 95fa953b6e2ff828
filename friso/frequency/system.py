"""Represent many linear systems with equal states at once: arrays with one system per row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class System:
    """Linear systems x' = a x + b u, y = c x + d u, as many as there are members.

    a (members, n, n), b (members, n, m), c (members, p, n), d (members, p, m), with the names of states, inputs and
    outputs. For a sampled system x' is the next x.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def take(self, inputs: Sequence[str], outputs: Sequence[str]) -> System:
        """Return the system with the given inputs and outputs only, in this order."""
        columns = [self.inputs.index(name) for name in inputs]
        rows = [self.outputs.index(name) for name in outputs]
        b, c, d = self.b[..., columns], self.c[..., rows, :], self.d[..., rows, :][..., columns]
        return System(self.a, b, c, d, self.states, tuple(inputs), tuple(outputs))

    def sees(self, name: str) -> bool:
        """Tell whether any state or output depends on the input with this name."""
        column = self.inputs.index(name)
        return bool(self.b[..., column].any() or self.d[..., column].any())

    def at(self, points: np.ndarray) -> Complex:
        """Return transfer matrices c (s - a)^-1 b + d at points s, (k,) or (members, k).

        The result has shape (members, k, p, m).
        """
        n = len(self.states)
        shifted = points[..., None, None] * np.eye(n) - self.a[:, None]
        answers = np.linalg.solve(shifted, self.b[:, None])
        return (self.c[:, None] @ answers + self.d[:, None]).astype(complex)
