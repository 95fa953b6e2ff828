"""Compute the margins of loops, of one machine and of a family: the gain, phase or delay that makes a loop unstable.

Margins follow Astrom, Murray 2008, Feedback Systems, chapter 9 (stability margins). Van Dijk's tuning rules (thesis,
Eq. 7 and 8) are applied to the mass that they are meant for.

A family has the states of a stage: stuck under any bias force, sliding at any speed. Friction is an impedance between
cart and ground, and the masses are computed once. The masses without friction respond to forces on stage and cart by g
(2 x 2), and by h with the cart held. With the dynamic stiffness k = s Z of friction on the cart, the stage responds by
(g_ss + k g_cc h)/(1 + k g_cc). No large numbers are subtracted, and each member (state) and frequency takes a few
operations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from friso.engine.side_by_side import side_by_side
from friso.equations.controllers.pid import as_gains, numbers, tuned
from friso.equations.structure import shared_structure
from friso.errors import InputError
from friso.frequency.loops import (
    FORCE,
    RATED,
    STAGE,
    VELOCITY,
    Poles,
    cart_states,
    compensator,
    controller_over_period,
    mechanics,
    operating_point,
    plant,
    poles,
    response,
    samples_controller,
)
from friso.frequency.system import (
    LIGHT_DAMPING,
    Complex,
    DriveTiming,
    Members,
    System,
    law_of,
    limit_cases,
    member,
    resonances,
)
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


MARGIN_DENSITY = 250  # [1/decade]
"""Frequencies per decade for margins. Fewer step over two crossings that lie close together."""

ALIAS_SHARE = 1e-3
"""Distance from the rate of the slowest loop, relative to it, within which rounding spoils a locus."""


def margins_of(at: LoopResponse, flat: Mapping[str, Any], member: Members, loop_poles: Poles) -> Margins:
    """Return the margins of one loop of a stage from its response, `at`, and its poles."""
    drive, closed = loop_poles.drive, loop_poles.in_s[0]
    resonant = [closed, drive.to_s(loop_poles.cut[0]), *([loop_poles.continuous] if drive.period > 1 else [])]
    omega, aside = frequencies(flat, member, drive, MARGIN_DENSITY, resonant), 1.0
    if drive.period > 1:
        apart = 2 * np.pi / (drive.sample_time * drive.period)
        omega, aside = (
            omega[np.abs(omega / apart - np.maximum(np.round(omega / apart), 1)) > ALIAS_SHARE],
            1 - ALIAS_SHARE,
        )
    ends = [*_at_rest(at, omega[0]), *([at(np.array([drive.highest * aside]))[0]] if drive.sample_time else [])]
    return of_loop(at, closed[np.isfinite(closed)], float(loop_poles.abscissa[0]), omega, np.array(ends, complex))


NEGLIGIBLE_POLE = 1e-12
"""Pole over the fastest that is 0 within rounding."""

FREQUENCIES_BEYOND = 100.0
"""Factor beyond the poles up to which crossings are searched; beyond it loops only fall."""


def frequencies(
    flat: Mapping[str, Any], members: Members, drive: DriveTiming, density: float, resonant: Sequence[Complex]
) -> np.ndarray:
    """Return angular frequencies [rad/s] that resolve the loops in all states, shape (k,).

    There are `density` per decade, up to the highest that the drive can represent, and more about the resonances among
    the poles `resonant`.
    """
    size = np.concatenate([np.abs(poles(flat, kind, DriveTiming(0.0, 0.0)).closed).ravel() for kind in members.kinds])
    size = size[size > NEGLIGIBLE_POLE * size.max(initial=0.0)] if size.any() else np.ones(1)
    low, high = size.min() / FREQUENCIES_BEYOND, min(size.max() * FREQUENCIES_BEYOND, drive.highest)
    return with_resonances(np.geomspace(low, high, int(density * np.log10(high / low)) + 2), resonant)


def with_resonances(even: np.ndarray, resonant: Sequence[Complex]) -> np.ndarray:
    """Return ascending angular frequencies [rad/s]: `even` ones, and more about resonances.

    `resonant` are poles [rad/s], of which the lightly damped ones count. The shape is (k,).
    """
    light = resonances(np.concatenate([roots.ravel() for roots in resonant]))
    near = (np.abs(light.imag)[:, None] + np.abs(light.real)[:, None] * AROUND_RESONANCE).ravel()
    return np.unique(np.concatenate([even, near[(near > even[0]) & (near < even[-1])]]))


REST_FREQUENCY = 1e-6
"""Frequency, relative to the loop's, below which a finite loop no longer changes."""


def _at_rest(at: LoopResponse, slow: float) -> list[complex]:
    """Return the loop at frequency 0 in a list, which is empty if it is not finite there.

    The loop counts as finite if it is real and constant towards 0. `slow` is a low frequency [rad/s].
    """
    low, lower = at(np.array([2 * REST_FREQUENCY, REST_FREQUENCY]) * slow)
    flat = np.abs(low - lower) < REST_FREQUENCY * np.abs(lower) and np.abs(lower.imag) < REST_FREQUENCY * np.abs(
        lower.real
    )
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


JUMP_SHARE = 1e-3
"""Remaining value of a function at a sign change, relative to its values, above which it jumps there."""


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
    crossings = {at for at, size in zip(zeros, sizes, strict=True) if abs(function(at)) <= JUMP_SHARE * size}
    return np.array(sorted({*crossings, *omega[values == 0].tolist()}))


REAL_SHARE = 1e-9
"""Imaginary over real part that may be rounding."""

VANISHING_LOOP = 1e-8
"""Magnitude of a loop that is only rounding: a mass behind a hold at half the sampling frequency."""


def _gains(response: LoopResponse, omega: np.ndarray, gains: Complex, ends: Complex) -> np.ndarray:
    """Return the gain factors that take the loop L through -1: where L is real and negative.

    `gains` are the values of L at the frequencies `omega` [rad/s]. `ends` are further real values, at rest and at half
    the sampling frequency. The result is empty if L is nowhere real and negative.
    """
    # leave out rounding
    clear = np.where(np.abs(gains.imag) > REAL_SHARE * np.abs(gains.real), gains.imag, np.nan)
    real = _roots(lambda w: response(np.array([w]))[0].imag, omega, clear)
    at = np.concatenate([response(real) if real.size else np.empty(0), ends])
    return -1 / at.real[at.real < -VANISHING_LOOP]


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


_T = TypeVar("_T")


BESIDE_RESONANCE = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
"""Frequencies about a closed-loop resonance at which it is evaluated, in half widths."""


FAMILY_DENSITY = 35  # [1/decade]
"""Frequencies per decade for a family. They find the states closest to -1, whose margins are then exact."""

CLOSEST_MEMBERS = 16
"""Members computed exactly, the nearest to -1 on the coarse grid."""


@dataclass(frozen=True)
class Scan:
    """Stability of a stage in many states, its members, as arrays of shape (members,).

    `flat` has the stage's keys in SI. Modulus margins are computed on first use.
    """

    flat: Mapping[str, Any]
    members: Members
    by_poles: PoleStability

    @property
    def abscissa(self) -> np.ndarray:
        """Return the real part [1/s] of the rightmost closed-loop pole in each state, (members,)."""
        return self.by_poles.abscissa

    @property
    def stable(self) -> np.ndarray:
        """Return in which states the stage is stable, shape (members,)."""
        return self.abscissa < 0

    @cached_property
    def distance(self) -> np.ndarray:
        """Return the least distance of the loop from -1 in each state, shape (members,).

        It is computed at common frequencies and near each state's closed-loop resonances. For the states that come
        closest to -1 it is exact.
        """
        omega = frequency_grid(self.flat, FAMILY_DENSITY)

        def shared(which: np.ndarray) -> np.ndarray:
            return distance_to_lines(loops(self.flat, self.members[which], omega))

        parts = _split(np.arange(len(self.members)))
        distance = np.concatenate(side_by_side([partial(shared, part) for part in parts]))
        distance = np.minimum(distance, self.by_poles.resonant)
        for k in np.argsort(np.where(self.stable, distance, np.inf))[:CLOSEST_MEMBERS]:
            exact = margins(self.flat, self.members[k]).modulus_margin
            distance[k] = distance[k] if np.isnan(exact) else exact
        return distance

    def worst(self, among: np.ndarray | None = None) -> int:
        """Return the index of the worst state: the least stable, or the one closest to -1.

        `among` marks the states to consider; None stands for all.
        """
        among = np.ones(len(self.members), bool) if among is None else among
        if not self.stable[among].all():
            return int(np.where(among, self.abscissa, -np.inf).argmax())
        return int(np.where(among, self.distance, np.inf).argmin())


def scan_stability(flat: Mapping[str, Any], members: Members) -> Scan:
    """Return the stability of a stage in every state of `members`, with modulus margins."""
    return Scan(flat, members, stability_by_poles(flat, members))


class PoleStability(NamedTuple):
    """Stability of a stage in many states by its closed-loop poles, both of shape (members,).

    `abscissa` is the real part of the rightmost pole [1/s], 0 on the edge of stability; `resonant` is the least abs(1 +
    L) about closed-loop resonances.
    """

    abscissa: np.ndarray
    resonant: np.ndarray


def stability_by_poles(flat: Mapping[str, Any], members: Members) -> PoleStability:
    """Return the stability of a stage in every state of `members`, by its closed-loop poles.

    `flat` has its keys in SI, which may be arrays of shape (members,), except the drive's.
    """
    by_poles = PoleStability(np.empty(len(members)), np.empty(len(members)))

    def look(part: Poles) -> PoleStability:
        distance = part.distance(np.nan_to_num(omega := about_resonances(part), nan=1.0))
        return PoleStability(part.abscissa, np.where(np.isnan(omega), np.inf, distance).min(axis=1))

    for which, looked in for_poles(flat, members, look):
        by_poles.abscissa[which], by_poles.resonant[which] = looked
    return by_poles


def for_poles(
    flat: Mapping[str, Any], members: Members, function: Callable[[Poles], _T]
) -> list[tuple[np.ndarray, _T]]:
    """Apply a function to the poles of a stage in many states, a few states at a time.

    Returns pairs of the states' numbers and the function's result. `flat` has the keys in SI, which may be arrays of
    shape (members,), except the drive's.
    """
    drive = DriveTiming.of(flat)

    def of_part(which: np.ndarray) -> tuple[np.ndarray, _T]:
        keys = {key: value[which] if np.ndim(value) else value for key, value in flat.items()}
        return which, function(poles(keys, members[which], drive))

    numbers = (np.flatnonzero(mask) for mask in (members.stuck, ~members.stuck))
    return side_by_side([partial(of_part, part) for numbers_of_kind in numbers for part in _split(numbers_of_kind)])


def spectral_abscissa(flat: Mapping[str, Any], members: Members) -> np.ndarray:
    """Return the real part [1/s] of the rightmost closed-loop pole, shape (members,).

    It is 0 on the edge of stability.
    """
    return stability_by_poles(flat, members).abscissa


def about_resonances(system: Poles) -> np.ndarray:
    """Return angular frequencies [rad/s] about each state's lightly damped closed-loop poles.

    The shape is (members, k), with NaN for states that have fewer. With loops at several rates all are NaN, because the
    poles do not show which alias resonates.
    """
    if system.drive.period > 1:  # its poles do not show which alias resonates
        return np.full((len(system.closed), 1), np.nan)
    closed = system.in_s
    light = (closed.imag > 0) & (np.abs(closed.real) < LIGHT_DAMPING * closed.imag)
    omega = (
        np.where(light, closed.imag, np.nan)[:, :, None]
        + BESIDE_RESONANCE * np.where(light, closed.real, np.nan)[:, :, None]
    )
    return np.clip(omega, 0, system.drive.highest).reshape(len(closed), -1)


def distance_to_lines(loop: Complex) -> np.ndarray:
    """Return the least distance of loops from -1, shape (...).

    Loops are given over ascending frequencies, shape (..., k), and joined by straight lines.
    """
    start, step = 1 + loop[..., :-1], np.diff(loop, axis=-1)
    length = np.maximum(np.abs(step) ** 2, np.finfo(float).tiny)
    along = np.clip(-(start * step.conj()).real / length, 0, 1)
    return np.abs(start + along * step).min(axis=-1)


def frequency_grid(flat: Mapping[str, Any], density: float) -> np.ndarray:
    """Return angular frequencies [rad/s] that resolve the loops in all limit cases, (k,).

    There are `density` per decade, and more about the resonances of plant and closed loop.
    """
    cases = Members.joined(limit_cases(flat).values())
    return frequencies(
        flat, cases, DriveTiming.of(flat), density, [plant_poles(flat, cases), closed_loop_poles(flat, cases)]
    )


def closed_loop_poles(flat: Mapping[str, Any], members: Members) -> Complex:
    """Return the finite closed-loop poles [rad/s] of a stage in all states of `members`, (n,)."""
    drive = DriveTiming.of(flat)
    roots = np.concatenate([poles(flat, kind, drive).in_s.ravel() for kind in members.kinds])
    return roots[np.isfinite(roots)]


def plant_poles(flat: Mapping[str, Any], members: Members) -> Complex:
    """Return the poles [rad/s] of the plant in all states of `members`, shape (n,)."""
    return np.concatenate([np.linalg.eigvals(plant(flat, kind).a).ravel() for kind in members.kinds]).astype(complex)


def plants(flat: Mapping[str, Any], members: Members, omega: np.ndarray) -> Complex:
    """Return stage position over actuator force [m/N], complex, shape (members, k).

    `omega` (k,) are angular frequencies [rad/s].
    """
    s = 1j * omega
    sides = np.unique(members.touched)
    side = np.searchsorted(sides, members.touched)
    masses = mechanics(flat, sides)
    g, held = masses.at(s)[side], _cart_held(flat, masses, s)[side]
    pushed = s * impedance(flat, members, s) * g[..., 1, 1]
    return (g[..., 0, 0] + pushed * held) / (1 + pushed)


def _cart_held(flat: Mapping[str, Any], masses: System, s: np.ndarray) -> Complex:
    """Return stage position over force [m/N] while the cart is held, shape (members, k).

    `masses` are the masses without friction, and `s`, shape (k,), complex frequencies [rad/s]. The result is 0 if cart
    and stage are one.
    """
    if shared_structure(flat).joint == "rigid":
        return np.zeros((len(masses.a), len(s)), complex)
    cart = cart_states(flat)
    held = [i for i, name in enumerate(masses.states) if name not in cart]
    return masses.keep(held).at(s)[..., 0, 0]


def loops(flat: Mapping[str, Any], members: Members, omega: np.ndarray) -> Complex:
    """Return the loops L in each state at angular frequencies [rad/s], shape (members, k).

    A sampled loop is taken without the aliases of the plant.
    """
    return bare_loops(flat, members, omega)(flat) * DriveTiming.of(flat).transfer(omega)


def bare_loops(flat: Mapping[str, Any], members: Members, omega: np.ndarray) -> Callable[[Mapping[str, Any]], Complex]:
    """Return a function from a stage's keys to its loops L without hold, delay, current loop.

    The keys may have any controller. L has the shape (members, k) over angular frequencies (k,) [rad/s]. Parts that do
    not depend on the controller are computed once.
    """
    if shared_structure(flat).transmission is None:
        bare = plants(flat, members, omega)
        return lambda keys: bare * controller_response(keys, omega)
    seen = _measured_compliance(flat, members, omega)
    return lambda keys: (seen * _channels(keys, omega)).sum(axis=-1)


MEMBERS_SOLVED_WHOLE = 16
"""Members for which all frequencies are solved at once, limited by memory."""


def _measured_compliance(flat: Mapping[str, Any], members: Members, omega: np.ndarray) -> Complex:
    """Return the measured signals over the force, shape (members, k, 2), from the whole plant.

    They are position [m/N] and velocity [m/(N s)]; for a sampled drive, the second is the position that it
    differentiates [m/N]. Encoders may be on different sides of a transmission. `members` are states of the stage.
    """
    second = RATED if DriveTiming.of(flat).sample_time else VELOCITY
    answers = np.empty((len(members), len(omega), 2), complex)
    for mask in (members.stuck, ~members.stuck):
        for part in np.array_split(np.flatnonzero(mask), -(-int(mask.sum()) // MEMBERS_SOLVED_WHOLE) or 1):
            machine = plant(flat, members[part]).take((FORCE,), (STAGE, second)) if len(part) else None
            if machine is not None:
                answers[part] = machine.at(1j * omega)[..., 0]
    return answers


def controller_response(flat: Mapping[str, Any], omega: np.ndarray) -> Complex:
    """Return the controller's force over a deviation of the stage [N/m], sign reversed, (k,).

    `omega` (k,) are angular frequencies [rad/s].
    """
    position, second = _channels(flat, omega).T
    return position + (second if DriveTiming.of(flat).sample_time else 1j * omega * second)


def _channels(flat: Mapping[str, Any], omega: np.ndarray) -> Complex:
    """Return the controller's force over each measured signal, sign reversed, shape (k, 2).

    The signals are position [N/m] and velocity [N s/m], or two positions for a sampled drive. With loops at several
    rates, the part at the frequency of the input counts.
    """
    drive = DriveTiming.of(flat)
    if drive.sample_time:
        controls, turn = samples_controller(flat, 1, drive.period), omega * drive.sample_time
        if drive.period == 1:
            return -controls[0].at(np.exp(1j * turn))[0, :, 0]
        lifted = (controller_over_period(controls, measured) for measured in (STAGE, RATED))
        return -np.stack([channel.fundamental(turn)[0] for channel in lifted], axis=1)
    return -compensator(flat, 1).take((STAGE, VELOCITY), (FORCE,)).at(1j * omega)[0, :, 0]


def impedance(flat: Mapping[str, Any], members: Members, s: np.ndarray) -> Complex:
    """Return the friction force over the cart's velocity [N s/m], shape (members, k).

    `members` are states of the stage, and `s` complex frequencies [rad/s], shape (k,).
    """
    law = law_of(flat)
    if law is None:
        return np.zeros((len(members), len(s)), complex)
    velocity = np.where(members.forward, members.speed, -members.speed)
    system = law.declared.at({**flat, **operating_point(flat, members), "velocity": velocity}, len(members))
    total = np.broadcast_to(system.d[:, 0], (len(members), len(s))).astype(complex)
    if law.states:
        values, vectors = np.linalg.eig(system.a)
        residues = (system.c @ vectors)[:, 0] * np.linalg.solve(vectors, system.b.astype(complex))[..., 0]
        for k in range(len(law.states)):
            total += residues[:, k, None] / (s - values[:, k, None])
    return total


MEMBERS_TOGETHER = 256
"""Members computed together. Larger arrays leave the processor's cache."""


def _split(numbers: np.ndarray) -> list[np.ndarray]:
    return np.array_split(numbers, -(-len(numbers) // MEMBERS_TOGETHER)) if len(numbers) else []
