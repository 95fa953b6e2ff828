"""Compute margins of one loop: the gain, phase or delay that makes it unstable.

Astrom, Murray 2008, Feedback Systems, chapter 9 (stability margins). Van Dijk's tuning rules (thesis, Eq. 7 and 8) are
applied to the mass that they are meant for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from friso.equations.controllers.van_dijk import as_gains, numbers, tuned
from friso.errors import InputError
from friso.frequency.loops import Poles, poles, response
from friso.frequency.members import Members, member
from friso.frequency.settings import settings
from friso.frequency.system import Complex, DriveTiming, resonances
from friso.stage.arguments import check_arguments
from friso.stage.stage import numeric_keys

AROUND_RESONANCE = np.tan(np.linspace(-1.5, 1.5, 15))
"""Frequencies about a resonance at which the loop is evaluated, in units of its half width."""


LoopResponse = Callable[[np.ndarray], Complex]


@dataclass(frozen=True)
class Margins:
    """Stability of a loop L cut at the actuator, and how far it is from the edge of stability.

    - `poles` [rad/s] of the closed loop (k,), complex; `abscissa` [1/s]: real part of the rightmost one, 0 on the edge
      of stability within rounding.
    - `crossovers` [Hz]: all frequencies where abs(L) = 1.
    - `phase_margin` [deg]: least lag or lead that takes the loop to the edge.
    - `gain_margin`, above 1, and `gain_reduction`, below 1: factors on the gain that take it there.
    - `delay_margin` [s]: delay that takes it there.
    - `modulus_margin`: least distance of L from -1, reached at `closest` [Hz].

    Margins are infinite (the reduction 0) if nothing takes the loop to the edge, and NaN for a loop that is not stable.
    """

    poles: Complex
    abscissa: float
    crossovers: tuple[float, ...]
    phase_margin: float
    gain_margin: float
    gain_reduction: float
    delay_margin: float
    modulus_margin: float
    closest: float

    @property
    def stable(self) -> bool:
        """Tell whether the closed loop is stable."""
        return self.abscissa < 0

    @property
    def on_the_edge(self) -> bool:
        """Tell whether a deviation neither dies out nor grows, like an undamped oscillation."""
        return self.abscissa == 0

    @property
    def peak_sensitivity(self) -> float:
        """Return the peak sensitivity, the largest absolute value of 1/(1 + L)."""
        return 1 / self.modulus_margin if self.modulus_margin else np.inf


def margins(flat: Mapping[str, Any], member: Members) -> Margins:
    """Return the margins of a stage in one of its states.

    Raises InputError for too long a delay (see `DriveTiming`).
    """
    drive = DriveTiming.of(flat)
    return margins_of(response(flat, member, drive), flat, member, poles(flat, member, drive))


def margins_of(at: LoopResponse, flat: Mapping[str, Any], member: Members, loop_poles: Poles) -> Margins:
    """Return the margins of one loop of a stage from its response, `at`, and its poles."""
    drive, closed = loop_poles.drive, loop_poles.in_s[0]
    resonant = [closed, drive.to_s(loop_poles.cut[0]), *([loop_poles.continuous] if drive.period > 1 else [])]
    omega, aside = frequencies(flat, member, drive, settings.margin_density, resonant), 1.0
    if drive.period > 1:
        apart = 2 * np.pi / (drive.sample_time * drive.period)
        omega, aside = (
            omega[np.abs(omega / apart - np.maximum(np.round(omega / apart), 1)) > settings.alias_share],
            1 - settings.alias_share,
        )
    ends = [*_at_rest(at, omega[0]), *([at(np.array([drive.highest * aside]))[0]] if drive.sample_time else [])]
    return of_loop(at, closed[np.isfinite(closed)], float(loop_poles.abscissa[0]), omega, np.array(ends, complex))


def frequencies(
    flat: Mapping[str, Any], members: Members, drive: DriveTiming, density: float, resonant: Sequence[Complex]
) -> np.ndarray:
    """Return angular frequencies [rad/s] that resolve the loops in all states, shape (k,).

    There are `density` per decade, up to the highest that the drive can represent, and more about the resonances among
    the poles `resonant`.
    """
    size = np.concatenate([np.abs(poles(flat, kind, DriveTiming(0.0, 0.0)).closed).ravel() for kind in members.kinds])
    size = size[size > settings.negligible_pole * size.max(initial=0.0)] if size.any() else np.ones(1)
    low, high = size.min() / settings.frequencies_beyond, min(size.max() * settings.frequencies_beyond, drive.highest)
    return with_resonances(np.geomspace(low, high, int(density * np.log10(high / low)) + 2), resonant)


def with_resonances(even: np.ndarray, resonant: Sequence[Complex]) -> np.ndarray:
    """Return ascending angular frequencies [rad/s]: `even` ones, and more about resonances.

    `resonant` are poles [rad/s], of which the lightly damped ones count. The shape is (k,).
    """
    light = resonances(np.concatenate([roots.ravel() for roots in resonant]))
    near = (np.abs(light.imag)[:, None] + np.abs(light.real)[:, None] * AROUND_RESONANCE).ravel()
    return np.unique(np.concatenate([even, near[(near > even[0]) & (near < even[-1])]]))


def _at_rest(at: LoopResponse, slow: float) -> list[complex]:
    """Return the loop at frequency 0 in a list, which is empty if it is not finite there.

    The loop counts as finite if it is real and constant towards 0. `slow` is a low frequency [rad/s].
    """
    low, lower = at(np.array([2 * settings.rest_frequency, settings.rest_frequency]) * slow)
    flat = np.abs(low - lower) < settings.rest_frequency * np.abs(lower) and np.abs(
        lower.imag
    ) < settings.rest_frequency * np.abs(lower.real)
    return [complex(lower.real)] if flat else []


def of_loop(response: LoopResponse, poles: Complex, abscissa: float, omega: np.ndarray, ends: Complex) -> Margins:
    """Return the margins of a loop from its response.

    `poles` belong to the closed loop, `abscissa` is the real part of the rightmost one, and `omega` are frequencies
    [rad/s] that resolve the loop. `ends` are values of the loop where it is real at any gain: at rest, and at half the
    sampling frequency.
    """
    seen = response(omega)
    crossovers = _roots(lambda w: _decades(response(np.array([w])))[0], omega, _decades(seen))
    if abscissa >= 0:
        return Margins(poles, abscissa, _hertz(crossovers), *[np.nan] * 6)
    turned = np.angle(-response(crossovers)) if crossovers.size else np.empty(0)
    gains = _gains(response, omega, seen, ends)
    closest, distance = _closest(response, omega, np.abs(1 + seen))
    return Margins(
        poles=poles,
        abscissa=abscissa,
        crossovers=_hertz(crossovers),
        phase_margin=float(np.degrees(np.abs(turned).min(initial=np.inf))),
        gain_margin=float(gains[gains > 1].min(initial=np.inf)),
        gain_reduction=float(gains[gains < 1].max(initial=0.0)),
        delay_margin=float((turned % (2 * np.pi) / crossovers).min(initial=np.inf)),
        modulus_margin=distance,
        closest=closest / (2 * np.pi),
    )


def _hertz(omega: np.ndarray) -> tuple[float, ...]:
    return tuple((omega / (2 * np.pi)).tolist())


def _decades(loop: Complex) -> np.ndarray:
    """Return the natural logarithm of the magnitude of a loop, which may be 0, in its shape."""
    return np.log(np.maximum(np.abs(loop), np.finfo(float).tiny))


def _roots(function: Callable[[float], float], omega: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the frequencies [rad/s], (n,), at which a function passes zero.

    `values` are those of the function at `omega`. Jumps, such as those of a locus that changes to an alias, do not
    count.
    """
    with np.errstate(invalid="ignore"):
        passes = np.flatnonzero(values[:-1] * values[1:] < 0)
    zeros: list[Any] = [
        brentq(function, omega[k], omega[k + 1], xtol=1e-14 * omega[k], rtol=np.float64(1e-13)) for k in passes
    ]
    sizes = np.maximum(np.abs(values[passes]), np.abs(values[passes + 1]))
    crossings = {at for at, size in zip(zeros, sizes, strict=True) if abs(function(at)) <= settings.jump_share * size}
    return np.array(sorted({*crossings, *omega[values == 0].tolist()}))


def _gains(response: LoopResponse, omega: np.ndarray, gains: Complex, ends: Complex) -> np.ndarray:
    """Return the gain factors that take the loop L through -1: where L is real and negative.

    `gains` are the values of L at the frequencies `omega` [rad/s]. `ends` are further real values, at rest and at half
    the sampling frequency. The result is empty if L is nowhere real and negative.
    """
    # leave out rounding
    clear = np.where(np.abs(gains.imag) > settings.real_share * np.abs(gains.real), gains.imag, np.nan)
    real = _roots(lambda w: response(np.array([w]))[0].imag, omega, clear)
    at = np.concatenate([response(real) if real.size else np.empty(0), ends])
    return -1 / at.real[at.real < -settings.vanishing_loop]


def _closest(response: LoopResponse, omega: np.ndarray, distance: np.ndarray) -> tuple[float, float]:
    """Return the frequency [rad/s] at which the loop L comes closest to -1, and the distance.

    `distance` has the distances at frequencies `omega` [rad/s].
    """
    inner = np.flatnonzero((distance[1:-1] <= distance[:-2]) & (distance[1:-1] <= distance[2:])) + 1
    least = int(distance.argmin())
    best = float(omega[least]), float(distance[least])
    for k in inner[distance[inner] < 1.1 * best[1]]:
        minimum: Any = minimize_scalar(
            lambda w: abs(1 + response(np.array([w]))[0]),
            bounds=(omega[k - 1], omega[k + 1]),
            method="bounded",
            options={"xatol": 1e-9 * omega[k]},
        )
        best = min(best, (float(minimum.x), float(minimum.fun)), key=lambda pair: pair[1])
    return best


@dataclass(frozen=True)
class Tuning:
    """Gain k_p [N/m] and time constants tau_z, tau_i, tau_p [s] of Eq. 8, with margins.

    The margins are those of the loop on the bare mass.

    Examples
    --------
    >>> import friso
    >>> found = friso.tuning(8.0, 0.1, 2.0, 1.7)
    >>> round(found.k_p), round(found.tau_z, 4)
    (1358, 0.0629)
    """

    k_p: float
    tau_z: float
    tau_i: float
    tau_p: float
    margins: Margins

    @property
    def parallel(self) -> dict[str, float]:
        """Return the gains of Eq. 6 by name: kp [N/m], ki [N/(m s)], kd [N s/m], tau [s].

        They act on the error behind the low-pass.
        """
        return as_gains(self.k_p, self.tau_z, self.tau_i, self.tau_p)

    @property
    def true_crossover(self) -> float:
        """Return the 0 dB crossing [Hz] of the loop, slightly above the tuned crossover."""
        return self.margins.crossovers[-1]


EXAMPLE, LARGEST_ARGUMENT = "friso.tuning(8.0, 0.1, 2.0, 1.7)", 1e30
"""Example call, and the largest number of any of its arguments."""


@check_arguments
def tuning(crossover: float, alpha: float, beta: float, mass: float) -> Tuning:
    """Return the controller for a mass [kg] at a crossover [Hz] by van Dijk's rules.

    `alpha` and `beta` are the rules' other numbers. The result includes the margins on that mass. Raises InputError
    for numbers that no stage file may have.

    Examples
    --------
    >>> import friso
    >>> round(friso.tuning(8.0, 0.1, 2.0, 1.7).true_crossover, 2)
    8.08
    """
    arguments = {"crossover": crossover, "alpha": alpha, "beta": beta, "mass": mass}
    for name, value in arguments.items():
        if not 1 / LARGEST_ARGUMENT <= value <= LARGEST_ARGUMENT:
            raise InputError(
                name, f"{value:g}", f"a number from {1 / LARGEST_ARGUMENT:g} to {LARGEST_ARGUMENT:g}", EXAMPLE
            )
    flat = {"friction.model": "none", "masses.stage": mass, **tuned(crossover, alpha, beta, mass)}
    for key, item in numeric_keys({**flat, "motion.kind": "hold"}).items():
        if key in flat and not item.bound.holds(flat[key]):
            raise InputError(key.split(".")[1], str(flat[key]), item.bound.text, EXAMPLE)
    return Tuning(**numbers(flat), margins=margins(flat, member()))
