"""Model one leaf as a plate, which is stiffer than a beam of equal section.

A leaf bent along its length curls across it (anticlastic curvature) and a twisted leaf warps, unless clamps prevent it;
both make the leaf stiffer near the clamps. The deflection is taken as W(x, y) = f(x) + g(x) (y^2/2 - w^2/24), for
twisting W = theta(x) y; Kirchhoff's energy is least for a function g (and theta) that solves a linear equation with
constant coefficients, which gives closed forms (Kantorovich's method; Timoshenko & Woinowsky-Krieger, Theory of Plates
and Shells, 1959, Sec. 82 for the energy). With more functions across the width the solution converges (tests/ritz.py)
to nearly constant multiples of the closed forms. The width is assumed to be many times the thickness.

Lengths in m, arrays allowed; s runs along the leaf from its middle, from -L/2 to L/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.leaf_springs.settings import settings

CONVERGED_STIFFENING, CONVERGED_PEAK = 0.878, 0.63
"""Fractions that remain with more functions across the width: of the stiffening (0.866 to 0.895 at a Poisson's ratio of
0.3, 0.854 to 0.909 from 0.05 to 0.45), and of the excess stress (0.60, for square leaves 0.65). They hold for leaves
from 1 to 6 times as long as wide (tests/ritz.py)."""


@dataclass(frozen=True)
class Curl:
    """Curvature across a leaf (anticlastic) that a bending moment along it causes.

    If `odd`, the moment is m = s, as in the parallel motion of the leaf's ends; otherwise m = 1, as where the ends turn
    against each other.

    g = -nu/(1 - nu^2) (m - a h1 - b h2), where m is the moment per flexural rigidity D w. h1 and h2 decay from the
    clamps (`rates` [1/m]). a and b (`weights`) make g and its slope 0 there.
    """

    poisson: Any
    rates: tuple[Any, Any]
    weights: tuple[Any, Any]
    odd: bool

    @classmethod
    def of(cls, length: Any, width: Any, poisson: Any, odd: bool) -> Curl:
        # w^4/720 g'''' - (1 - nu) w^2/6 g'' + (1 - nu^2) g = -nu m; both squares are positive up to nu = 1/2
        """Return the curvature of leaves of a length and width [m].

        `odd` stands for a moment that changes sign in the middle.
        """
        middle, square = (1 - poisson) / 6, 4 * (1 - poisson**2) / 720
        root = np.sqrt(middle**2 - square)
        fast, slow = (np.sqrt(360 * (middle + sign * root)) / width for sign in (1, -1))
        half = length / 2
        at_clamp = (half, 1.0) if odd else (1.0, 0.0)
        # a + b = m, a slope_1 + b slope_2 = m' at the clamp, where h is 1 and h' is rate/tanh or rate tanh
        tanhs = [np.tanh(rate * half) for rate in (fast, slow)]
        slopes = [rate / (tanh if odd else 1 / tanh) for rate, tanh in zip((fast, slow), tanhs, strict=True)]
        a = (at_clamp[1] - at_clamp[0] * slopes[1]) / (slopes[0] - slopes[1])
        return cls(poisson, (fast, slow), (a, at_clamp[0] - a), odd)

    def shape(self, s: Any, length: Any, derivative: int = 0) -> Any:
        """Return m - a h1 - b h2 at s or, if `derivative` is 2, its second derivative."""
        moment = (s if self.odd else 1.0) if derivative == 0 else 0.0
        terms = (
            weight * rate**derivative * _decay(rate, s, length, self.odd)
            for rate, weight in zip(self.rates, self.weights, strict=True)
        )
        return moment - sum(terms)

    def curvature(self, s: Any, length: Any) -> Any:
        """Return the curvature f'' along the leaf at s, under the moment m."""
        moment = s if self.odd else 1.0
        return moment + self.poisson**2 / (1 - self.poisson**2) * self.shape(s, length)


def _decay(rate: Any, s: Any, length: Any, odd: bool) -> Any:
    """Return sinh(rate s) / sinh(rate L/2) if `odd`, else cosh(rate s) / cosh(rate L/2).

    Neither overflows.
    """
    half = rate * length / 2
    sign = -1.0 if odd else 1.0
    size = np.abs(s)
    ratio = (np.exp(rate * size - half) + sign * np.exp(-rate * size - half)) / (1 + sign * np.exp(-2 * half))
    return np.sign(s) * ratio if odd else ratio


def stiffening(length: Any, width: Any, poisson: Any, odd: bool = True) -> Any:
    """Return the factor by which clamps make a leaf stiffer than a beam.

    The factor grows from 1 for a narrow leaf to 1/(1 - nu^2) for a wide one. If `odd`, it is for the parallel motion of
    the ends, k = factor 12 E I/L^3; otherwise for turning them against each other, k = factor E I/L.
    """
    curl = Curl.of(length, width, poisson, odd)
    # compliance: integral of f'' m over that of m^2, times (1 - nu^2) for a beam
    share = poisson**2 / (1 - poisson**2)
    beam = length**3 / 12 if odd else length
    decays = zip(curl.rates, curl.weights, strict=True)
    reduction = sum(weight * _moment_of(rate, length, odd) for rate, weight in decays)
    compliance = 1 + share * (1 - reduction / beam)
    return 1 + CONVERGED_STIFFENING * (1 / ((1 - poisson**2) * compliance) - 1)


def compliance_profile(s: Any, length: Any, width: Any, poisson: Any) -> Any:
    """Return the bending compliance at s relative to a beam.

    A beam with this compliance has the stiffness of the plate in the parallel motion of its ends.
    """
    curl = Curl.of(length, width, poisson, odd=True)
    stiff = 1 - (1 - poisson**2) * curl.curvature(s, length) / s
    factor = stiffening(length, width, poisson)
    return (
        1 - stiff * (CONVERGED_STIFFENING + factor - 1) / factor
    )  # fraction of `stiff` that remains with more functions


def _moment_of(rate: Any, length: Any, odd: bool) -> Any:
    """Return the integral of `_decay` times the moment m over a leaf: m = s if `odd`, else 1."""
    half = rate * length / 2
    return (length * rate / np.tanh(half) - 2) / rate**2 if odd else 2 * np.tanh(half) / rate


def stress_factors(length: Any, width: Any, poisson: Any) -> tuple[Any, Any]:
    """Return the bending stress at the clamp relative to a beam, 3 E t delta/L^2.

    The first factor is the mean over the width. The second is the largest, except at the very corners, where theory has
    no bound.
    """
    curl = Curl.of(length, width, poisson, odd=True)
    half = length / 2
    mean = stiffening(length, width, poisson)
    uncurling = poisson / (1 - poisson**2) * curl.shape(half, length, derivative=2) * width**2 / 24
    return mean, 1 + CONVERGED_PEAK * (mean * (1 + uncurling / half) - 1)


def warping_rate(width: Any, poisson: Any) -> Any:
    """Return the rate [1/m] at which a clamp's restraint of warping decays along a twisted leaf."""
    return np.sqrt(24 * (1 - poisson)) / width


def torsion_stiffness(length: Any, width: Any, thickness: Any, shear: Any, poisson: Any) -> Any:
    """Return the torsional stiffness of a leaf between clamps [N m/rad].

    `shear` is its shear modulus [Pa]; lengths are in metres [m].
    """
    u = warping_rate(width, poisson) * length / 2
    return torsion_constant(width, thickness) * shear / length / (1 - np.tanh(u) / u)


def torsion_constant(width: Any, thickness: Any) -> Any:
    """Return J of a rectangle [m^4] (Roark's formula) whose width exceeds its thickness."""
    ratio = thickness / width
    return width * thickness**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12))


def cubic_twist(s: Any, length: Any, width: Any, poisson: Any) -> Any:
    """Return the rate of twist at s under a torque that goes with s^3.

    A force across a deflected leaf makes such a torque. A leaf free to warp would twist at the rate s^3. The clamps
    change it: p - p''/rate^2 = s^3, with p = 0 at the clamps. s is in half lengths, from -1 to 1.
    """
    rate = warping_rate(width, poisson) * length / 2
    return s**3 + 6 * s / rate**2 - (1 + 6 / rate**2) * _decay(rate, s, 2.0, odd=True)


def tilted(shares: np.ndarray, torques: np.ndarray, places: np.ndarray, weighted_sum: float) -> np.ndarray:
    """Multiply torsional compliances `shares` (n,) by exp(tilt place^2), for a tilt to be found.

    `places` (n,) run along the leaf. The tilt makes the sum of the compliances, weighted by the square of the `torques`
    (n,), equal to `weighted_sum`. Their plain sum stays, so that an even torque twists the leaf as before.
    """
    tilt, total = 0.0, shares.sum()
    for _ in range(settings.tilt_iterations):
        now = shares * np.exp(tilt * places**2)
        now *= total / now.sum()
        met = now @ torques**2
        slope = now @ (torques * places) ** 2 - met * (now @ places**2) / total
        tilt += (weighted_sum - met) / slope
    now = shares * np.exp(tilt * places**2)
    return now * total / now.sum()


def free_twist(s: Any, length: Any, width: Any, poisson: Any) -> Any:
    """Return the rate of twist at s relative to a leaf free to warp, under an even torque."""
    return 1 - _decay(warping_rate(width, poisson), s, length, odd=False)


def stretching(length: Any, width: Any, poisson: Any) -> Any:
    """Return the factor by which a leaf is stiffer along its length than a rod.

    The clamps of the leaf keep it from growing narrower. The factor is fitted to shells (tests/shells.py) of 0.6 to 6
    times the width in length, with Poisson's ratios from 0 to 0.45.
    """
    return 1 / (1 - 0.28 * poisson**2 * width / length)


def edgewise_shear_factor(length: Any, width: Any, poisson: Any) -> Any:
    """Return the factor by which a leaf is stiffer against shear in its plane than a beam.

    Bending of the leaf in that plane is taken as for a beam. The factor is fitted to shells (tests/shells.py).
    """
    ratio = length / width
    beam = 2.4 * (1 + poisson) * ratio
    return beam / np.maximum(beam - 0.55 * poisson**2 * ratio**2 - 0.076 - 0.13 * poisson, beam / 2)
