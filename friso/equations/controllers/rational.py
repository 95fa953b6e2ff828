"""Controllers given as a transfer function of the error: by coefficients, by zeros and poles, or by sections.

The transfer function is split into gain k0/(s + p) + gain R(s). The first term is an integral, which may leak at a rate
p; R(s) is a product of second-order sections.

A transfer function in z is converted by the bilinear transform (Tustin). A drive with the same sample time converts it
back exactly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import model_validator

from friso.errors import InputError, StageError
from friso.quantities import Number, Quantity, Value, positive
from friso.stage import register_controller
from friso.stage.controllers import CONTROLLER, FILTER_ARRAY, ControllerSection, PidLike
from friso.stage.section import (
    Coefficients,
    OneTable,
    Rows,
    Rule,
    TableArray,
    UncertainSection,
    Values,
    element_keys,
    row_keys,
)
from friso.stage.tables import TIME_ROUNDING, moving_mass

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.blocks import Blocks, Measured, Signal


SAMPLE_TIME, DRIVE_TIME, LOOP_TIME = f"{CONTROLLER}.sample_time", "drive.sample_time", "drive.position_sample_time"
PARTS = "parts"
"""Prefix of the keys in a stage that hold the coefficients of integral and sections."""

AT_ZERO = 1e3 * TIME_ROUNDING
"""Largest distance from 0 (in z: from 1) at which a pole counts as an integrator, relative to the largest pole (in z:
to 1).

Rounding moves poles by less."""


class TransferRoots(NamedTuple):
    """Zeros, poles and gain of a transfer function gain prod(x - zeros)/prod(x - poles).

    The variable x is s [1/s] or z.
    """

    zeros: np.ndarray
    poles: np.ndarray
    gain: float


class RationalTerms(NamedTuple):
    """Which terms a transfer function has.

    `integral` is true if it has one, and `leaks` if that leaks. `order` counts the poles beside it. `sampled` is true
    if the coefficients are for samples.
    """

    integral: bool
    order: int
    sampled: bool
    leaks: bool = False


def _divides(flat: Mapping[str, Any]) -> Any:
    """Tell whether the sample time of the controller is a whole multiple of the drive's.

    The result is true if one of both is missing, and an array if keys are arrays.
    """
    if SAMPLE_TIME not in flat or DRIVE_TIME not in flat:
        return True
    ratio = flat[SAMPLE_TIME] / flat[DRIVE_TIME]
    return (ratio > 1 - 1e-9) & (abs(ratio - np.round(ratio)) < 1e-9 * ratio)


class RationalController(ControllerSection):
    """Base of controllers that are transfer functions; a subclass says how roots are given."""

    gain: Annotated[float, Number(positive, "1.0")] = 1.0
    """Factor on the force."""
    speed: Annotated[float, Number(positive, "1.0")] = 1.0
    """Factor on the frequencies of all zeros and poles."""
    sample_time: Annotated[Value | None, Quantity("s", positive, "1 ms")] = None
    """Time between samples of a transfer function in z; without it, the transfer function is in s."""

    speeds_up: ClassVar[Mapping[str, int]] = MappingProxyType({"gain": 2, "speed": 1})
    loop_gain = ("gain",)
    shares: ClassVar[Mapping[str, str]] = MappingProxyType({"i": "integral", "r": "rest"})
    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (SAMPLE_TIME, DRIVE_TIME),
            _divides,
            "a whole number of samples of the drive",
            'sample_time = "1 ms" with [drive] sample_time = "125 us"',
        ),
        Rule(
            (SAMPLE_TIME, "drive.integral_discretisation"),
            lambda f: SAMPLE_TIME not in f or f.get("drive.integral_discretisation", "bilinear") == "bilinear",
            "no rule of the drive for a controller whose coefficients are for samples already",
            'sample_time = "1 ms" without integral_discretisation',
        ),
    )

    @classmethod
    def roots(cls, flat: Mapping[str, Any]) -> TransferRoots:
        """Return zeros, poles and gain of the transfer function, in s or in z.

        Raises InputError for keys that give no proper transfer function.
        """
        raise NotImplementedError

    @classmethod
    def with_defaults(cls, flat: Mapping[str, Any]) -> dict[str, Any]:
        """Compute the keys that hold the coefficients of the integral and of second-order sections.

        The controller's sample time becomes the drive's, if the file gives none for the drive.
        """
        roots, times = cls.roots(flat), flat.get(SAMPLE_TIME)
        if times is None or not np.ndim(times):
            return {**_coefficients(roots, times), **_timing(flat)}
        by_time = [_coefficients(roots, time) for time in np.asarray(times)]
        return {**{key: np.array([one[key] for one in by_time]) for key in by_time[0]}, **_timing(flat)}

    @classmethod
    def variant(cls, flat: Mapping[str, Any]) -> RationalTerms:
        """Return which terms the transfer function has, from a stage's keys in SI."""
        orders = (number for number in range(1, len(flat)) if cls.key(f"{PARTS}.{number}.b1") not in flat)
        sections = next(orders) - 1
        odd = sections > 0 and cls.key(f"{PARTS}.{sections}.a2") not in flat
        leaks = cls.key(f"{PARTS}.leak") in flat
        return RationalTerms(cls.integrates(flat), 2 * sections - odd, SAMPLE_TIME in flat, leaks)

    @classmethod
    def integrates(cls, flat: Mapping[str, Any]) -> bool:
        """Tell whether the controller has an integral: a pole at s = 0 (z = 1).

        A slow real pole counts as well, as an integral that leaks.
        """
        return cls.key(f"{PARTS}.integral") in flat

    def note(self, flat: Mapping[str, Any]) -> str:
        """Say what a verdict assumes of a sampled controller, and of its integral at the limit of the force."""
        says = []
        if SAMPLE_TIME in flat:
            says.append(
                "The verdict is on the continuous equivalent (Tustin) of the controller, whose coefficients are for "
                f"samples of {flat[SAMPLE_TIME]:g} s."
            )
        if self.force_limit is not None and self.anti_windup is None and self.integrates(flat):
            says.append(
                "The file does not say what the integral does at the limit of the force: it is taken to rest there "
                '(anti_windup = "clamp"); an output that is only clipped is "none".'
            )
        return " ".join(says)

    @classmethod
    def stiffness(cls, blocks: Blocks, variant: RationalTerms) -> sp.Expr:
        """Return the static stiffness in parallel with the integral [N/m]."""
        return blocks.key("gain") * blocks.key(f"{PARTS}.stiffness")

    @classmethod
    def as_pid(cls, flat: Mapping[str, Any]) -> PidLike:
        """Return the gains at low frequencies."""
        gain, speed, parts = flat[cls.key("gain")], flat[cls.key("speed")], cls.key(f"{PARTS}.")
        times = {key: value / speed for key, value in flat.items() if key.startswith(parts)}
        lead, lag = (sum(times[key] for key in times if key.endswith(name)) for name in (".b1", ".a1"))
        kp, ki = gain * flat[f"{parts}stiffness"], gain * speed * flat.get(f"{parts}integral", 0.0)
        return PidLike(kp, ki, kp * max(lead - lag, 0.0), lag, moving_mass(flat))

    @classmethod
    def draw(cls, canvas: Any, flat: Mapping[str, Any]) -> None:
        """Draw a box with the order of the transfer function."""
        order = cls.variant(flat).order + cls.integrates(flat)
        canvas.box(f"C({'z' if SAMPLE_TIME in flat else 's'}), order {order}")

    @classmethod
    def declare(cls, measured: Measured, blocks: Blocks, variant: RationalTerms) -> Mapping[str, Signal]:
        """Return the parts of the force [N]: the integral, and the product of the sections."""
        gain, speed = blocks.key("gain"), blocks.key("speed")
        rule = "bilinear" if variant.sampled else None
        with blocks.loop("position"):
            rest = measured.error
            for number in range(1, (variant.order + 1) // 2 + 1):
                first = variant.order % 2 and 2 * number > variant.order

                def key(name: str, number: int = number) -> sp.Symbol:
                    return blocks.key(f"{PARTS}.{number}.{name}")

                upper = (1, key("b1") / speed, 0 if first else key("b2") / speed**2)
                lower = (1, key("a1") / speed, 0 if first else key("a2") / speed**2)
                rest = blocks.transfer(rest, upper, lower, f"section_{number}", rule)
            shares = {"r": blocks.handed_on(rest * (gain * blocks.key(f"{PARTS}.stiffness")), "rest")}
            if variant.integral:
                leak = speed * blocks.key(f"{PARTS}.leak") if variant.leaks else None
                rate = gain * speed * blocks.key(f"{PARTS}.integral")
                integral = blocks.integral(measured.error, rate, leak=leak)
                shares = {"i": integral, **shares}
        return shares


def _timing(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the timing keys that follow from the controller's own sample time [s].

    That time becomes the drive's sample time if the file has none. Otherwise it becomes the period of a controller that
    runs more slowly than the drive.
    """
    if SAMPLE_TIME not in flat:
        return {}
    if DRIVE_TIME not in flat:
        return {DRIVE_TIME: flat[SAMPLE_TIME]}
    slower = np.all(_divides(flat)) and np.any(flat[SAMPLE_TIME] > flat[DRIVE_TIME] * (1 + 1e-9))
    return {LOOP_TIME: flat[SAMPLE_TIME]} if slower else {}


def _coefficients(roots: TransferRoots, sample_time: float | None) -> dict[str, float]:
    """Compute integral, static stiffness and sections of a transfer function, by key [SI].

    `roots` are its zeros, poles and gain. `sample_time` [s] is that of a transfer function in z, None for one in s.
    Raises InputError for a controller that is unstable, is not proper, has several integrals, or does not pull back.
    """
    zeros, poles, scale = _times(roots, sample_time)
    infinite = np.isinf(poles)
    if np.count_nonzero(infinite) > 1:
        raise _wrong("two poles or more at 0 (z = 1)", "one integral at most")
    if np.any(np.real(poles) <= 0):
        raise _unstable(roots.poles, sample_time)
    poles = poles[~infinite]
    if len(zeros) > len(poles) + bool(infinite.any()):
        counts = f"{len(zeros)} zeros and {len(poles) + bool(infinite.any())} poles"
        raise _wrong(counts, "a proper transfer function: no more zeros than poles, and none of these at z = -1")
    keys: dict[str, float] = {}
    stiffness = scale
    if infinite.any():
        share, stiffness, zeros = _beside(0.0, zeros, poles)
        keys[f"{PARTS}.integral"], stiffness = scale * share, scale * stiffness
    elif poles.size and (slowest := poles[np.argmax(np.abs(poles))]).imag == 0:
        rest, leak = poles[poles != slowest], 1 / slowest.real
        share, static, others = _beside(leak, zeros, rest)
        if share > 0 and static * leak > AT_ZERO and len(rest) + 1 == len(poles):
            # a drive's integrator leaks by backward Euler, which gives exactly the file's pole in z
            half = leak * (sample_time or 0.0) / 2
            keys |= {f"{PARTS}.integral": scale * leak * share / (1 - half), f"{PARTS}.leak": leak / (1 - half)}
            stiffness, zeros, poles = scale * leak * static, others, rest
    keys[f"{PARTS}.stiffness"] = stiffness
    terms = {"static stiffness": stiffness, "gain of the integral": keys.get(f"{PARTS}.integral", 1.0)}
    for name, value in terms.items():
        if not value > 0:
            raise _wrong(f"a {name} of {value:.6g}", f"a controller that pulls back: a {name} greater than 0")
    sections = zip_longest(_sections(zeros), _sections(poles), fillvalue=(0.0, None))
    for number, ((b1, b2), (a1, a2)) in enumerate(sections, start=1):
        keys |= {f"{PARTS}.{number}.b1": b1, f"{PARTS}.{number}.a1": a1}
        keys |= {} if a2 is None else {f"{PARTS}.{number}.b2": b2 or 0.0, f"{PARTS}.{number}.a2": a2}
    return {ControllerSection.key(name): float(value) for name, value in keys.items()}


def _beside(leak: float, zeros: np.ndarray, poles: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Split a transfer function into the part of its one slow pole and the rest.

    The whole is prod(1 + t s) of zeros over (s + leak) prod(1 + t s) of poles, equal to k0/(s + leak) + R(s). Returns
    k0, R(0) and the times t of the zeros of R.
    """
    upper, lower = _expanded(zeros), _expanded(poles)
    at_the_pole = [np.polyval(part[::-1], -leak) for part in (upper, lower)]
    share = float(at_the_pole[0] / at_the_pole[1])
    gap = np.array([a - share * b for a, b in zip_longest(upper, lower, fillvalue=0.0)])
    gap = np.polydiv(gap[::-1], [1.0, leak])[0][::-1] if gap.size > 1 else np.zeros(1)
    return share, float(gap[0]), -np.roots(np.trim_zeros(gap / gap[0], "b")) if gap[0] else np.zeros(0)


def _times(roots: TransferRoots, sample_time: float | None) -> tuple[np.ndarray, np.ndarray, float]:
    """Return zeros and poles as times t of factors 1 + t s, and the gain before them.

    A pole at s = 0 has an infinite time. With a `sample_time` T [s] the roots are in z, else in s. A root r in z
    becomes, with z = (1 + s T/2)/(1 - s T/2), the factor (1 - r) + (1 + r) s T/2.
    """
    zeros, poles = np.asarray(roots.zeros, complex), np.asarray(roots.poles, complex)
    if sample_time is None:
        pairs = [(-part, np.ones(len(part))) for part in (zeros, poles)]
    else:
        pairs = [(1 - part, (1 + part) * sample_time / 2) for part in (zeros, poles)]
        lacking = np.ones(max(len(poles) - len(zeros), 0))  # a zero at z = infinity is the factor 1 - s T/2
        pairs[0] = np.append(pairs[0][0], lacking), np.append(pairs[0][1], -lacking * sample_time / 2)
    (upper, upper_rate), (lower, lower_rate) = pairs
    largest = 1.0 if sample_time is not None else np.abs(poles).max(initial=0.0)
    lower = np.where(np.abs(lower) <= AT_ZERO * largest, 0.0, lower)
    upper = np.where(np.abs(upper) <= AT_ZERO * largest, 0.0, upper)
    if np.any(upper == 0) and np.any(lower == 0):  # a zero and a pole at the integrator cancel
        (upper, upper_rate), (lower, lower_rate) = (
            (np.delete(part, first), np.delete(rate, first))
            for part, rate in ((upper, upper_rate), (lower, lower_rate))
            for first in [int(np.argmax(part == 0))]
        )
    if np.any(upper == 0):
        raise _wrong("a zero at 0 (z = 1)", "a controller that pulls back: static stiffness greater than 0")
    free = lower == 0
    with np.errstate(divide="ignore", invalid="ignore"):
        times = upper_rate / upper, np.where(free, np.inf, lower_rate / lower)
    scale = roots.gain * np.prod(upper) / np.prod(lower[~free]) / np.prod(lower_rate[free])
    kept = [part[part != 0] for part in times]
    return kept[0], kept[1], float(np.real(scale))


def _expanded(times: np.ndarray) -> np.ndarray:
    """Return the coefficients of 1, s, s^2, ... of prod(1 + t s) over the `times` t."""
    polynomial = np.ones(1, complex)
    for time in times:
        polynomial = np.append(polynomial, 0) + time * np.append(0, polynomial)
    return np.real(polynomial)


def _sections(times: np.ndarray) -> list[tuple[float, float | None]]:
    """Return the coefficients of s and s^2 of second-order factors, one pair for each factor.

    The factors are products of two factors 1 + t s, for the `times` t. With an odd number of times, the last factor is
    of first order and has None for s^2.
    """
    pairs = sorted((t for t in times if t.imag > 1e-12 * abs(t)), key=abs, reverse=True)
    real = sorted((t.real for t in times if abs(t.imag) <= 1e-12 * abs(t)), key=abs, reverse=True)
    factors: list[tuple[float, float | None]] = [(2 * t.real, abs(t) ** 2) for t in pairs]
    factors += [(a + b, a * b) for a, b in zip(real[::2], real[1::2], strict=False)]
    return factors + ([(real[-1], None)] if len(real) % 2 else [])


def _wrong(actual: str, expected: str) -> InputError:
    return InputError(CONTROLLER, actual, expected)


def _unstable(poles: np.ndarray, sample_time: float | None) -> InputError:
    """Make the error for an unstable pole, in z if there is a `sample_time`, else in s."""
    if sample_time is None:
        worst = poles[np.argmax(np.real(poles))]
        expected = "poles left of 0, and one at 0 for an integral; a transfer function in z needs its sample_time"
        return _wrong(f"a pole at s = {worst:.10g}", f"a stable transfer function: {expected}")
    worst = poles[np.argmax(np.abs(poles))]
    expected = "poles within the unit circle, and one at 1 for an integral, with all their digits; a transfer function"
    return _wrong(f"a pole at z = {worst:.10g}", f"a stable transfer function: {expected} in s has no sample_time")


def polynomial_roots(numerator: Sequence[float], denominator: Sequence[float]) -> TransferRoots:
    """Return the roots of numerator / denominator, polynomials from the highest power down.

    Raises InputError if the coefficients of either are all 0, or if the numerator has the higher degree.
    """
    upper, lower = (np.trim_zeros(np.asarray(part, float), "f") for part in (numerator, denominator))
    if not upper.size or not lower.size:
        raise _wrong("coefficients that are all 0", "a transfer function")
    if len(upper) > len(lower):
        raise _wrong(
            f"a numerator of degree {len(upper) - 1} over a denominator of degree {len(lower) - 1}",
            "a proper transfer function, the highest powers first",
        )
    return TransferRoots(np.roots(upper), np.roots(lower), float(upper[0] / lower[0]))


FACTORS = dict.fromkeys(("gain", "speed", "sample_time"))
"""Keys that change a transfer function in s; without them it is as its coefficients say."""


def with_filter(pid: PidLike) -> float:
    """Return the time [s] of the filter that makes a PID controller proper: its own, or a tenth of kd/kp."""
    return pid.tau or (pid.kd / pid.kp / 10 if pid.kp and pid.kd else 1e-3)


WAYS = ("denominator", "poles", "sections")
"""Keys of which each selects one way to give a transfer function."""


class TransferSection(UncertainSection):
    """A section of the transfer function: a quotient of polynomials, their highest powers first."""

    numerator: Annotated[Values, Coefficients((1.0, 120.0, 3600.0))]
    denominator: Annotated[Values, Coefficients((1.0, 300.0, 0.0))]


_SECTIONS = TableArray(
    OneTable(TransferSection), "[[controller.sections]] numerator = [1, 20], denominator = [1, 400]", FILTER_ARRAY.most
)


def _ways(flat: Mapping[str, Any]) -> int:
    """Return in how many ways the transfer function is given."""
    return sum(any(key.startswith(f"controller.{way}.") for key in flat) for way in WAYS)


@register_controller
class TransferFunction(RationalController):
    """Force over error as a transfer function in s, or with a sample_time in z; in SI.

    It is given in one of three ways.
    """

    kind: Literal["transfer_function"]
    numerator: Annotated[Values | None, Coefficients((2e3, 8e4, 4e5))] = None
    denominator: Annotated[Values | None, Coefficients((1.0, 400.0, 0.0))] = None
    """Coefficients of the denominator, the highest power first."""
    zeros: Annotated[Values | None, Coefficients((-6.0, "-30+10j"), roots=True)] = None
    poles: Annotated[Values | None, Coefficients((0.0, -400.0), roots=True)] = None
    """Poles in 1/s, or in z; a complex pole includes its conjugate, and `gain` multiplies the whole."""
    sections: Annotated[Rows, _SECTIONS] = Rows()
    """Sections whose product is the transfer function."""

    rules: ClassVar[tuple[Rule, ...]] = RationalController.rules

    @model_validator(mode="after")
    def _roots_have_a_gain(self) -> Self:
        if self.poles is not None and self.denominator is None and "gain" not in self.model_fields_set:
            raise StageError("gain", "nothing", "the gain before the product of zeros over poles, in SI", "gain = 2e3")
        return self

    @classmethod
    def like_pid(cls, pid: PidLike) -> dict[str, Any]:
        """Return numerator and denominator in s."""
        tau = with_filter(pid)
        numerator = [pid.kp * tau + pid.kd, pid.kp + pid.ki * tau, pid.ki]
        return {"numerator": numerator, "denominator": [tau, 1.0, 0.0], **FACTORS}

    @classmethod
    def roots(cls, flat: Mapping[str, Any]) -> TransferRoots:
        """Return zeros, poles and gain, whichever way the file gives them.

        Raises InputError if the file gives them in none of the three ways, in several, or as a quotient that is not
        proper.
        """
        if _ways(flat) != 1:
            actual = "none of them" if not _ways(flat) else "several of them"
            expected = "one of numerator and denominator, zeros and poles, or [[controller.sections]]"
            raise InputError("controller", actual, expected, "numerator = [2e3, 8e4, 4e5], denominator = [1, 400, 0]")
        if row_keys(flat, cls.key("sections")):
            parts = [_quotient(flat, place) for place in row_keys(flat, cls.key("sections"))]
            zeros, poles, gains = zip(*parts, strict=True)
            return TransferRoots(np.concatenate(zeros), np.concatenate(poles), float(np.prod(gains)))
        if element_keys(flat, cls.key("poles")):
            zeros, poles = (_roots(flat, cls.key(name)) for name in ("zeros", "poles"))
            return TransferRoots(zeros, poles, 1.0)
        return _quotient(flat, "controller")


def _quotient(flat: Mapping[str, Any], place: str) -> TransferRoots:
    """Return the roots of numerator and denominator in the table `place` of a stage file."""
    numerator, denominator = (
        [flat[key] for key in element_keys(flat, f"{place}.{name}")] for name in ("numerator", "denominator")
    )
    return polynomial_roots(numerator or [1.0], denominator)


def _roots(flat: Mapping[str, Any], key: str) -> np.ndarray:
    """Return the complex roots listed under a key, (n,); conjugates of complex ones are added."""
    roots = [complex(flat[name]) for name in element_keys(flat, key)]
    return np.array([one for root in roots for one in ((root, root.conjugate()) if root.imag else (root,))])
