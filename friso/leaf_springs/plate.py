"""One leaf as the plate that it is: what a beam of the same section lacks.

A leaf bent along its length wants to curl across it (anticlastic curvature), which its clamps forbid; and a twisted
leaf wants to warp, which they forbid as well. Both make it stiffer than a beam, near the clamps more than away from
them. The deflection is taken as W(x, y) = f(x) + g(x) (y^2/2 - w^2/24), for twisting W = theta(x) y; Kirchhoff's
energy is least for a function g (and theta) that solves a linear equation with constant coefficients, so that
everything has a closed form (Kantorovich's method; Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells,
1959, Sec. 82 for the energy). With more functions across the width the solution converges (tests/ritz.py); what is
left of the closed forms then is nearly the same for all leaves. The width is assumed to be many times the thickness.

Lengths in m, arrays allowed; s runs along the leaf from its middle, from -L/2 to L/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.leaf_springs.settings import LeafSpringSettings

CONVERGED, PEAK = 0.878, 0.63
"""What more functions across the width leave of the stiffening (0.866 to 0.895 at a Poisson's ratio of 0.3, 0.854 to
0.909 from 0.05 to 0.45), and of the excess of the stress (0.60, for square leaves 0.65), of leaves from 1 to 6 times as
long as wide (tests/ritz.py)."""


@dataclass(frozen=True)
class Curl:
    """The anticlastic curvature of a leaf under a bending moment that is odd ("s", as in the parallel motion of its
    ends) or even ("1", as where they are turned against each other) about its middle.

    g = -nu/(1 - nu^2) (m - a h1 - b h2), where m = s or 1 is the moment per flexural rigidity D w, and h1, h2 decay
    from the clamps (`rates` [1/m]); a and b are such that g and its slope are 0 there.
    """

    poisson: Any
    rates: tuple[Any, Any]
    weights: tuple[Any, Any]
    odd: bool

    @classmethod
    def of(cls, length: Any, width: Any, poisson: Any, odd: bool) -> Curl:
        # w^4/720 g'''' - (1 - nu) w^2/6 g'' + (1 - nu^2) g = -nu m; both squares are positive up to nu = 1/2
        """The profile of leaves of a length and width [m]; `odd` for a moment that changes sign in the middle."""
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
        """m - a h1 - b h2 at s, or its second derivative."""
        moment = (s if self.odd else 1.0) if derivative == 0 else 0.0
        terms = (
            weight * rate**derivative * _decay(rate, s, length, self.odd)
            for rate, weight in zip(self.rates, self.weights, strict=True)
        )
        return moment - sum(terms)

    def curvature(self, s: Any, length: Any) -> Any:
        """f'' at s for the moment m."""
        moment = s if self.odd else 1.0
        return moment + self.poisson**2 / (1 - self.poisson**2) * self.shape(s, length)


def _decay(rate: Any, s: Any, length: Any, odd: bool) -> Any:
    """sinh(rate s) / sinh(rate L/2), or with cosh, without overflow."""
    half = rate * length / 2
    sign = -1.0 if odd else 1.0
    size = np.abs(s)
    ratio = (np.exp(rate * size - half) + sign * np.exp(-rate * size - half)) / (1 + sign * np.exp(-2 * half))
    return np.sign(s) * ratio if odd else ratio


def stiffening(length: Any, width: Any, poisson: Any, odd: bool = True) -> Any:
    """By what factor the leaf is stiffer than a beam: from 1 (narrow) to 1/(1 - nu^2) (wide).

    Odd: for the parallel motion of its ends, k = factor 12 E I/L^3. Even: for turning them against each other,
    k = factor E I/L.
    """
    curl = Curl.of(length, width, poisson, odd)
    # compliance: integral of f'' m over that of m^2, times (1 - nu^2) for a beam
    share = poisson**2 / (1 - poisson**2)
    beam = length**3 / 12 if odd else length
    reduction = sum(
        weight * _moment_of(rate, length, odd) for rate, weight in zip(curl.rates, curl.weights, strict=True)
    )
    compliance = 1 + share * (1 - reduction / beam)
    return 1 + CONVERGED * (1 / ((1 - poisson**2) * compliance) - 1)


def compliance_profile(s: Any, length: Any, width: Any, poisson: Any) -> Any:
    """Bending compliance at s over that of a beam, such that a beam with it has the stiffness of the plate in the
    parallel motion of its ends."""
    curl = Curl.of(length, width, poisson, odd=True)
    stiff = 1 - (1 - poisson**2) * curl.curvature(s, length) / s
    factor = stiffening(length, width, poisson)
    return 1 - stiff * (CONVERGED + factor - 1) / factor  # the share of `stiff` that more functions leave


def _moment_of(rate: Any, length: Any, odd: bool) -> Any:
    """Integral over the leaf of the decaying function times m."""
    half = rate * length / 2
    return (length * rate / np.tanh(half) - 2) / rate**2 if odd else 2 * np.tanh(half) / rate


def stress_factors(length: Any, width: Any, poisson: Any) -> tuple[Any, Any]:
    """Bending stress at the clamp over that of a beam, 3 E t delta/L^2: its mean over the width, and the largest (but
    for the very corners, where theory has no bound)."""
    curl = Curl.of(length, width, poisson, odd=True)
    half = length / 2
    mean = stiffening(length, width, poisson)
    uncurling = poisson / (1 - poisson**2) * curl.shape(half, length, derivative=2) * width**2 / 24
    return mean, 1 + PEAK * (mean * (1 + uncurling / half) - 1)


def warping_rate(width: Any, poisson: Any) -> Any:
    """Rate [1/m] at which the restraint of warping by a clamp decays along a twisted leaf."""
    return np.sqrt(24 * (1 - poisson)) / width


def torsion_stiffness(length: Any, width: Any, thickness: Any, shear: Any, poisson: Any) -> Any:
    """Torsional stiffness of a leaf between clamps [N m/rad], `shear` its shear modulus [Pa]."""
    u = warping_rate(width, poisson) * length / 2
    return torsion_constant(width, thickness) * shear / length / (1 - np.tanh(u) / u)


def torsion_constant(width: Any, thickness: Any) -> Any:
    """J of a rectangle [m^4] (Roark's formula), the width larger than the thickness."""
    ratio = thickness / width
    return width * thickness**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12))


def cubic_twist(s: Any, length: Any, width: Any, poisson: Any) -> Any:
    """Rate of twist at s under a torque that goes with s^3, as that across a deflected leaf makes, in which a leaf free
    to warp would have s^3: p - p''/rate^2 = s^3, with p = 0 at the clamps. s in half lengths, from -1 to 1."""
    rate = warping_rate(width, poisson) * length / 2
    return s**3 + 6 * s / rate**2 - (1 + 6 / rate**2) * _decay(rate, s, 2.0, odd=True)


def tilted(shares: np.ndarray, torques: np.ndarray, places: np.ndarray, weighted_sum: float) -> np.ndarray:
    """Compliances in torsion along a leaf (n,), changed by exp(tilt place^2) such that their sum stays (an even torque
    twists the leaf as before) and that weighted by the square of the `torques` (n,) is `weighted_sum`."""
    settings = LeafSpringSettings.current()
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
    """Rate of twist at s over that of a leaf free to warp, under an even torque."""
    return 1 - _decay(warping_rate(width, poisson), s, length, odd=False)


def stretching(length: Any, width: Any, poisson: Any) -> Any:
    """By what factor a leaf is stiffer along its length than a rod, since its clamps forbid it to grow narrower: fitted
    to shells (tests/shells.py) of 0.6 to 6 times the width in length and Poisson's ratios from 0 to 0.45."""
    return 1 / (1 - 0.28 * poisson**2 * width / length)


def edgewise_shear_factor(length: Any, width: Any, poisson: Any) -> Any:
    """By what factor a leaf is stiffer against shear in its plane than a beam, its bending there being that of a beam
    (fitted to the same shells)."""
    ratio = length / width
    beam = 2.4 * (1 + poisson) * ratio
    return beam / np.maximum(beam - 0.55 * poisson**2 * ratio**2 - 0.076 - 0.13 * poisson, beam / 2)
