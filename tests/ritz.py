"""A clamped plate bent like a leaf, by Ritz's method: the slow twin of friso/leaf_springs/mechanism.py.

Kirchhoff's energy of a plate (length L, width w, Poisson's ratio nu) whose ends stay parallel and move against each
other, in units of its flexural rigidity. The deflection is a sum of products X(x) Y(y): the cubic of a beam, and
bubbles times odd Legendre polynomials along, times even Legendre polynomials across. Nothing here is shared with friso.
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

ALONG, ACROSS = 14, 6  # functions; the stiffness is converged to 1e-4
_X, _WX = legendre.leggauss(60)
_Y, _WY = legendre.leggauss(30)


class Plate(NamedTuple):
    """The solution: `stiffening` over a beam of the same section, and its functions and their amplitudes."""

    stiffening: float
    length: float
    poisson: float
    along: list[np.ndarray]
    across: list[np.ndarray]
    amplitudes: np.ndarray

    def clamp_stress(self, eta: ArrayLike) -> np.ndarray:
        """Return the bending stress at the clamp over that of a beam of equal deflection.

        eta runs from -1 to 1 across the leaf.
        """
        eta = np.asarray(eta, dtype=float)
        curvature = _derived(self.along[0], 1.0, 2) * np.ones_like(eta)
        k = 0
        for f in self.along[1:]:
            for g in self.across:
                curvature += self.amplitudes[k] * _derived(f, 1.0, 2) * legendre.legval(eta, g)
                k += 1
        beam = -3 / 2 * (1 - self.poisson**2) * 2  # of the cubic (3 xi - xi^3)/2, whose second derivative is -3 xi
        return curvature / beam


def plate(length: float, width: float, poisson: float, along: int = ALONG, across: int = ACROSS) -> Plate:
    """Return the plate with `along` functions along it and `across` functions across it."""
    bubble = legendre.poly2leg([1, 0, -2, 0, 1])
    cubic = legendre.poly2leg([0, 1.5, 0, -0.5])
    inner = [legendre.legmul(bubble, legendre.Legendre.basis(2 * i + 1).coef) for i in range(along)]
    even = [legendre.Legendre.basis(2 * j).coef for j in range(across)]
    products = [(cubic, even[0])] + [(f, g) for f in inner for g in even]
    curved = np.array([_curvatures(f, g, 2 / length, 2 / width) for f, g in products])
    xx, yy, xy = (curved[:, i].reshape(len(products), -1) for i in range(3))
    area = np.outer(_WX, _WY).ravel() * length * width / 4
    energy = xx * area @ xx.T + yy * area @ yy.T + 2 * (1 - poisson) * (xy * area) @ xy.T
    mixed = xx * area @ yy.T
    energy += poisson * (mixed + mixed.T)
    scale = 1 / np.sqrt(np.diag(energy))  # equal diagonal: solved without loss of digits
    scaled = energy * np.outer(scale, scale)
    shares = np.linalg.solve(scaled[1:, 1:], -scaled[1:, 0]) * scale[1:] / scale[0]
    stiffness = (energy[0, 0] + energy[0, 1:] @ shares) / 4  # the ends are 2 apart
    beam = (1 - poisson**2) * 12 * width / length**3
    return Plate(float(stiffness / beam), length, poisson, [cubic, *inner], even, shares)


def _curvatures(f: np.ndarray, g: np.ndarray, a: float, b: float) -> np.ndarray:
    """Return curvatures along, across and of twist of the product f(x) g(y).

    They are given at the points, shape (3, points x, points y).
    """
    x = [_derived(f, _X, d) * a**d for d in range(3)]
    y = [_derived(g, _Y, d) * b**d for d in range(3)]
    return np.array([np.outer(x[2], y[0]), np.outer(x[0], y[2]), np.outer(x[1], y[1])])


def _derived(series: np.ndarray, at: ArrayLike, order: int) -> np.ndarray:
    return legendre.legval(at, legendre.legder(series, order)) if order < len(series) else 0 * np.asarray(at, float)
