"""Write numbers and keys for readers, and choose the sentences of an answer.

Numbers have the SI prefix that suits them, and may be ranges or percentages.

Sentences come from a table of conditions and templates, which has one row of alternatives for every sentence. An
alternative is a condition with a template; the first one whose condition holds is said. Names in braces stand for
numbers and words, which are computed when said.

An unstable loop has its own sentence, because it matters more than anything that friction does. Other sentences say on
which unknown values an answer rests, and by how much machines drawn at random differ from each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from friso.axis import axis_shown, unit_shown
from friso.quantities import NOTHING, percent
from friso.shown.drawing.figure import Array
from friso.stage import Stage
from friso.stage.contacts import followed
from friso.stage.controllers import CONTROLLER, CONTROLLERS, FORCE_LIMIT
from friso.stage.rig import is_as_built
from friso.stage.tables import friction_laws

if TYPE_CHECKING:
    from friso.hunting import LoopState
    from friso.intervals import Share


# Prefixes by exponent of ten, and the smallest and largest exponent of the units that take them: lengths beyond metres,
# times beyond seconds and slow frequencies are read best as they are.
_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_PREFIXED = {"m": (-9, 0), "rad": (-9, 0), "s": (-9, 0), "N": (-9, 9), "J": (-9, 9), "Hz": (0, 9)}
_SIGNS = str.maketrans({"*": "·"})
_POWERS = {"^2": "²", "^3": "³", "**2": "²", "**3": "³"}

SOLVED_LENGTH = 1e-9
"""Length [m] below which a simulated motion cannot be told from rest."""


def choose(values: Array, unit: str, *, log: bool = False) -> tuple[float, str]:
    """Return factor and prefixed unit for `values` [unit]: prefixed value = factor * value.

    The unit follows the kind of axis: "m" is "rad" on a rotary one. If a prefix allows it, the largest magnitude falls
    between 1 and 1000; on a logarithmic axis, the middle of the range does. Units without prefix (kg, m^2) keep the
    factor 1. Only finite values count.
    """
    unit = unit_shown(unit)
    symbol = unit.replace("**", "^").replace("/", "*").split("*")[0]
    text = pretty(unit)
    magnitudes = np.abs(values[np.isfinite(values) & (values != 0)])
    if symbol not in _PREFIXED or magnitudes.size == 0:
        return 1.0, text
    size = float(np.max(magnitudes))
    if log:
        size = math.sqrt(size) * math.sqrt(float(np.min(magnitudes)))
    # 1e-9 of slack: a largest value of 0.001 m is 1 mm although 0.001 * 1000 may fall short of 1
    exponent = 3 * math.floor((math.log10(size) + 1e-9) / 3)
    smallest, largest = _PREFIXED[symbol]
    exponent = min(max(exponent, smallest), largest)
    return 10.0**-exponent, _PREFIXES[exponent] + text


def pretty(unit: str) -> str:
    """Return a unit as it is printed: "N*s/m^2" becomes "N·s/m²".

    On a rotary axis it becomes a rotary unit.
    """
    unit = unit_shown(unit)
    for plain, raised in _POWERS.items():
        unit = unit.replace(plain, raised)
    return unit.translate(_SIGNS)


def with_unit(value: float | None, unit: str, digits: int = 3) -> str:
    """Write a value [unit] with significant `digits`, e.g. "0.52 mm"; a dash without a value.

    A length that the encoder of the axis does not see, or that no run resolves, is only said to be shorter than that.
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if unseen(value, unit):
        return f"< {with_unit(finest_length(), unit)}"
    factor, text = choose(np.array([value]), unit)
    number = value * factor
    if number == 0 or 1e-3 <= abs(number) < 1e5:
        return f"{_significant(number, digits)} {text}"
    return f"{number:.{digits - 1}e} {text}"


def finest_length() -> float:
    """Return the length [m] below which no number is written: a step of the encoder, or a thousandth of a nanometre."""
    return axis_shown().finest or SOLVED_LENGTH / 1000


def unseen(value: float, unit: str) -> bool:
    """Tell whether a value [unit] is a length that is finer than what is written, but not 0."""
    return unit == "m" and 0 < abs(value) < finest_length() * (1 - 1e-9)


def length_at_rest(value: float, within: float = 0.0) -> str:
    """Write how far [m] a stage still moves.

    Below a nanometre, digits would only show the solver's error. Nobody sees what is below a step of the encoder, and
    nobody asks for what is below the tolerance that the stage states, `within` [m].
    """
    if value < (least := max(finest_length(), within, SOLVED_LENGTH)):
        return f"< {with_unit(least, 'm')}"
    return with_unit(value, "m")


def digits_that_differ(values: Sequence[float]) -> int:
    """Return how many significant digits make different numbers look different, at least three."""
    return next(digits for digits in range(3, 18) if len({f"{x:.{digits - 1}e}" for x in values}) == len({*values}))


def rounded_up(value: float, digits: int = 3) -> float:
    """Round a positive value up to `digits` significant digits."""
    unit = 10.0 ** (math.floor(math.log10(value) + 1e-12) - digits + 1)
    return math.ceil(value / unit - 1e-9) * unit


def rounded_down(value: float, digits: int = 3) -> float:
    """Round a positive value down to `digits` significant digits."""
    unit = 10.0 ** (math.floor(math.log10(value) + 1e-12) - digits + 1)
    return math.floor(value / unit + 1e-9) * unit


def range_with_unit(low: float, high: float, unit: str, digits: int = 3) -> str:
    """Write a range [unit] for a table or a sentence, e.g. "1.72 to 10.8 mm".

    A wide range has two prefixes. A range whose ends have equal digits is a single number.
    """
    if unseen(low, unit):
        return with_unit(high, unit) if unseen(high, unit) else f"{with_unit(low, unit)} to {with_unit(high, unit)}"
    factor, text = choose(np.array([low, high]), unit)
    if 0 < low * factor < 0.01:
        return f"{with_unit(low, unit, digits)} to {with_unit(high, unit, digits)}"
    first, last = _significant(low * factor, digits), _significant(high * factor, digits)
    return f"{first} {text}" if first == last else f"{first} to {last} {text}"


def window_with_unit(low: float, high: float, searched: tuple[float, float], unit: str) -> str:
    """Write the part of a searched range [unit] in words.

    The part counts as open at an end that is also an end of the search.
    """
    if (low, high) == searched:
        return f"all from {range_with_unit(low, high, unit)}"
    if low == searched[0]:
        return f"up to {with_unit(high, unit)}"
    return f"from {with_unit(low, unit)} on" if high == searched[1] else range_with_unit(low, high, unit)


_LOPSIDED = 0.1
"""Smallest difference of the two ends of a swing, relative to the larger one, from which on both are written."""


def swing_with_unit(half: float, middle: float, unit: str, digits: int = 3) -> str:
    """Write a swing [unit] about a reference: "±0.52 mm", or "from −1.54 to +10.6 mm about its target".

    `half` is half of peak to peak, and `middle` the middle between the peaks. Both ends are written if they differ.
    """
    if unseen(half, unit):
        return f"less than ±{with_unit(finest_length(), unit)}"
    factor, text = choose(np.array([2 * half]), unit)
    low, high = (factor * (middle + side * half) for side in (-1, 1))
    if abs(low + high) > _LOPSIDED * max(abs(low), abs(high)):
        first, last = (f"{'+' if end > 0 else '−'}{abs(end):.{digits}g}" for end in (low, high))
        return f"from {first} to {last} {text} about its target"
    return f"±{half * factor:.{digits}g} {text}"


def share_with_interval(share: Share) -> str:
    """Write a fraction and its interval in percent; only exactly 0 and 1 become 0 and 100 %."""
    middle = f"{percentage(share.probability)} %" if math.isfinite(share.probability) else "unknown"
    return f"{middle} ({percentage(share.low)} to {percentage(share.high)} %)"


def percent_range(low: float, high: float) -> str:
    """Write two fractions in percent, with one percent sign for both."""
    return f"{percent(low).removesuffix(' %')} to {percent(high)}"


def percentage(part: float) -> str:
    """Write a fraction in percent without the sign, to a tenth; to a hundredth near 0 and 100."""
    return f"{100 * part:.{1 if part in (0, 1) or 0.001 <= part <= 0.999 else 2}f}"


def listed(parts: Sequence[str], word: str) -> str:
    """Join parts by commas and a word: "a", "a or b", "a, b or c"."""
    return f" {word} ".join(part for part in (", ".join(parts[:-1]), *parts[-1:]) if part)


def _significant(number: float, digits: int) -> str:
    """Write `digits` significant digits without an exponent: 1234.5 becomes 1234, not 1.23e+03."""
    if number == 0:
        return "0"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(number)) + 1e-12))
    return f"{number:.{decimals}f}"


_QUANTITIES = {
    FORCE_LIMIT: "Force limit",
    "joint.limiter_damping": "Limiter damping",
    "joint.limiter_stiffness": "Limiter stiffness",
    "joint.locked": "Joint",
    "masses.cart": "Cart mass",
    "masses.stage": "Stage mass",
}


def key_in_words(key: str) -> str:
    """Return a key in words: "joint.stroke" is "Joint stroke"; a free name stays as it is."""
    of_laws = {f"friction.{key}": word for law in friction_laws().values() for key, word in law.words.items()}
    quantities = _QUANTITIES | of_laws | CONTROLLERS.words
    if key in quantities:
        return quantities[key]
    for table in (f"{CONTROLLER}.", "friction.", "motion."):
        key = key.removeprefix(table)
    words = key.replace("_", " ").replace(".", " ")
    return words[:1].upper() + words[1:]


def lost_as_built(stage: Stage) -> tuple[LoopState, ...]:
    """Return the states in which samples and delays of the drive make the loop of a stage unstable."""
    if not any(key.startswith("drive.") for key in stage.flat()):
        return ()
    from friso.frequency.bode import unstable_as_built  # 0.3 s to import

    states: tuple[LoopState, LoopState] = ("sticks", "slides")
    return tuple(state for state, lost in zip(states, unstable_as_built(stage.flat()), strict=True) if lost)


def without_drive(stage: Stage) -> str:
    """Write as a condition that an answer leaves out the drive, which makes the loop unstable; "" if it does not."""
    lost = lost_as_built(stage)
    return "Without the samples and delays of its drive, with which the loop is unstable: " if lost else ""


def unstable_loop(states: tuple[LoopState, ...]) -> list[str]:
    """Say in which states the loop of the stage as given is unstable; [] for a stable loop."""
    return [f"The loop of the stage as its file gives it is {unstable_where(states)}."] if states else []


def unstable_where(states: tuple[LoopState, ...]) -> str:
    """Say in which states a loop is unstable, and what to do about it."""
    where = listed([f"while the stage {state}" for state in states], "and")
    return f"unstable {where}, whatever the friction: retune the controller (friso bode)"


def after_loop(does: str, unstable: tuple[LoopState, ...], as_built: tuple[LoopState, ...] = ()) -> str:
    """Say in the fewest words that a loop is unstable, itself or with its drive, and what the stage `does` then.

    A state is named if the loop is stable in the other one.
    """
    states, drive, then = (unstable, "", "; ") if unstable else (as_built, " with its delay", "; without: ")
    if not states:
        return does
    where = "" if len(states) > 1 else f" while it {next(iter(states))}"
    return f"unstable{drive}{where}{then if does else ''}{does}"


def spread_sentences(from_file: Sequence[str], spreads: Mapping[str, float]) -> list[str]:
    """Say which keys vary as the stage file says, and the default spreads [%] of others."""
    sentences = [f"Uncertain as in the stage file: {', '.join(from_file)}."] if from_file else []
    if spreads:
        listed = ", ".join(f"{key} ±{spread:g} %" for key, spread in spreads.items())
        sentences.append(f"Default spreads (95 % of the machines), as the stage file gives none: {listed}.")
    return sentences


Subject = TypeVar("Subject")
Alternatives = Sequence[tuple[Callable[[Subject], object], str]]
Words = Mapping[str, Callable[[Subject], str]]


def say(subject: Subject, table: Sequence[Alternatives[Subject]], words: Words[Subject]) -> list[str]:
    """Return the sentences of a table that hold for a subject, at most one per row, each with a capital letter."""
    written = _Written(subject, words)
    chosen = (next((text for holds, text in row if holds(subject)), "") for row in table)
    sentences = (text.format_map(written) for text in chosen if text)
    return [f"{sentence[:1].upper()}{sentence[1:]}" for sentence in sentences]


def say_all(subject: Subject, rows: Alternatives[Subject], words: Words[Subject]) -> list[str]:
    """Return every sentence of a list whose condition holds for a subject."""
    return say(subject, [[row] for row in rows], words)


def always(subject: object) -> bool:
    """Hold for every subject, as the last alternative of a row."""
    return True


class _Written(dict[str, str], Generic[Subject]):
    """Words of a subject by name, each written when it is first read."""

    def __init__(self, subject: Subject, words: Words[Subject]) -> None:
        super().__init__()
        self._subject, self._words = subject, words

    def __missing__(self, name: str) -> str:
        self[name] = self._words[name](self._subject)
        return self[name]


def unknown_condition(stage: Stage | None, varied: Collection[str] = ()) -> str:
    """Write the condition under which an answer holds, with a colon and a blank behind it.

    The values are those that the stage file lists as unknown, or the centres of their ranges, except for the keys that
    are `varied`; what follows one of these is said to do so. Returns "" if there are none.
    """
    unknown = [] if stage is None else [key for key in stage.unknown_keys if key not in varied]
    if stage is None or not unknown:
        return ""
    flat, keys = stage.flat(), stage.numeric_keys()
    values = {key: with_unit(flat[key], keys[key].unit) for key in unknown if key in keys and key in flat}
    leads = followed(stage, dict.fromkeys(varied, 1.0))
    texts = [f"{key} is {values.get(key, 'as written')}" for key in unknown if key not in leads]
    for lead in dict.fromkeys(lead for lead, _ in leads.values()):
        keys_of = [key for key in unknown if key in leads and leads[key][0] == lead]
        texts.append(f"{listed(keys_of, 'and')} follow{'s' * (len(keys_of) == 1)} {lead}")
    return f"If {listed(texts, 'and')}, which the stage file lists as unknown: "


def if_so(stage: Stage) -> str:
    """Return what stands behind the name of a case: that it is in continuous time, or holds if values are so.

    The first is said of a stage with a drive, the second of one with unknown values.
    """
    return f"{', in continuous time' * is_as_built(stage)}{', if so' * bool(stage.assumed_keys)}"
