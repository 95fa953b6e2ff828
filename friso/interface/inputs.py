"""Read stages and numbers with units in all the forms in which people give them."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral
from pathlib import Path
from typing import Any, TypeAlias

from friso.errors import InputError, StageError
from friso.platform.system import shell_word
from friso.quantities import Bound, Quantity, exactly, quoted
from friso.stage import Stage, load, parse_set
from friso.stage.correlations import Correlations, correlations_file, read_correlations
from friso.stage.plausible import idle_encoder, implausible_values
from friso.stage.rig import AS_BUILT, left_out
from friso.stage.tables_of_files import load_changed, load_tables

StageLike: TypeAlias = Stage | str | os.PathLike[str] | Mapping[str, Any]
"""A stage, the path of a stage file, or its tables as a dictionary."""

StageLikes: TypeAlias = StageLike | Sequence[StageLike]
"""A stage, or several."""

Changes: TypeAlias = Mapping[str, Any] | Iterable[str] | None
"""Keys to be overridden: a dictionary, or texts KEY=VALUE."""

Whole: TypeAlias = int
"""A whole number of any size, whose limits `whole_number` checks."""

Seed: TypeAlias = int
"""A seed of random numbers, from 0 to 2147483647."""

LengthLike: TypeAlias = float | str
TimeLike: TypeAlias = float | str
ForceLike: TypeAlias = float | str
FrequencyLike: TypeAlias = float | str
RatioLike: TypeAlias = float | str
Tolerance: TypeAlias = float | str
"""Numbers in SI units, or texts with a unit: "1 um". These are the types of tolerances and quantities."""

AxisRange: TypeAlias = str
AxisPoints: TypeAlias = str
FrequencyBand: TypeAlias = str
LengthRange: TypeAlias = str
"""Texts with a range: 'controller.crossover="1 Hz..40 Hz"', with ":41" for points behind it, "0.1 Hz..1 kHz"."""

KindName: TypeAlias = str
MetricName: TypeAlias = str
FormatName: TypeAlias = str
ExperimentName: TypeAlias = str
StudyName: TypeAlias = str
ClaimName: TypeAlias = str
Address: TypeAlias = str
"""Names chosen from a list (a wrong name is answered with the list); and the address of a scheduler."""


Roles: TypeAlias = Changes
ChannelUnits: TypeAlias = Changes
RoleScales: TypeAlias = Changes
"""Dictionaries, or texts NAME=VALUE: channels by role, units by channel, scales by role."""

MOST_NAMED = 3
"""Largest number of uncertain keys that a message names."""

LOGGER = logging.getLogger("friso")


def stage_of(source: StageLike, changes: Changes = None) -> Stage:
    """Read a stage from a Stage, path or dictionary, and override keys.

    Raises InputError if the source or a change does not give a valid stage.
    """
    wanted = changes_of(changes)
    if isinstance(source, Stage | Mapping):
        stage = source if isinstance(source, Stage) else Stage(**source)
    else:
        try:
            stage = load(source)
        except StageError:
            if not wanted:
                raise
            return load_changed(Path(source), wanted)
    if changes is not None and not isinstance(changes, Mapping):
        in_units = stage.in_own_units(wanted)
        for key in (key for key, value in wanted.items() if in_units[key] != value):
            note(f"{key}={wanted[key]} is taken as {in_units[key]}")
        wanted = in_units
    return stage.replace(wanted) if wanted else stage


def file_of(source: StageLike, changes: Changes = None) -> str:
    """Return the path of a stage file as a word of a command line; "" for another source, or with changed keys."""
    return "" if isinstance(source, Stage | Mapping) or changes_of(changes) else shell_word(str(source))


def note(text: str, **marks: bool) -> None:
    """Log what is to be known about an input; the command line says it once, after the answer."""
    LOGGER.warning(text, extra={"after": True, **marks})


def tables_of(source: StageLike) -> dict[str, Any]:
    """Return the tables of a stage file as written, even if incomplete.

    Raises InputError for a file that cannot be read.
    """
    if isinstance(source, Stage):
        return source.as_written()
    return dict(source) if isinstance(source, Mapping) else load_tables(source)


def changes_of(changes: Changes) -> dict[str, Any]:
    """Return new values by key, from a dictionary or texts KEY=VALUE.

    Raises InputError for anything else.
    """
    if changes is None:
        return {}
    keys: list[Any] = [*changes] if isinstance(changes, Iterable) and not isinstance(changes, str | bytes) else [None]
    if not all(isinstance(key, str) for key in keys):
        expected = "a dictionary of keys, or texts KEY=VALUE"
        raise wrong("set", type(changes).__name__, expected, '{"masses.stage": "0.6 kg"}')
    return dict(changes) if isinstance(changes, Mapping) else dict(map(parse_set, keys))


def read_stage(
    source: StageLike, changes: Changes = None, leaves_out: Sequence[str] = AS_BUILT, uncertain_too: bool = False
) -> Stage:
    """Read a stage, override keys, and log doubts about the stage.

    The logger "friso" reports that centres of uncertain keys are used (unless `uncertain_too`), and names the tables
    that the analysis `leaves_out`. Raises InputError if the source or a change does not give a valid stage.
    """
    stage = stage_of(source, changes)
    for doubt in (*implausible_values(stage), *idle_encoder(stage)):
        note(doubt)
    keys = [] if uncertain_too else [*stage.uncertain()]
    if keys:
        several = f"{len(keys)} keys are" if len(keys) > 1 else "1 key is"
        named = ", ".join([*keys[:MOST_NAMED], *(["..."] if len(keys) > MOST_NAMED else [])])
        centres = "their centres are" if len(keys) > 1 else "its centre is"
        note(f"{several} uncertain ({named}): {centres} used; friso check --draws 1000 samples the whole range")
    if left := left_out(stage, leaves_out):
        note(left)
    return stage


def mention_sampling(stage: Stage) -> None:
    """Log that runs are of the machine as built, and at which sample time [s]."""
    from friso.shown.text import with_unit
    from friso.virtual_rig.task import SAMPLE_TIME

    stated = stage.flat().get("drive.sample_time")
    every = with_unit(stated or SAMPLE_TIME, "s")
    usual = "" if stated else ", as drive.sample_time is not given"
    note(f"runs are of the machine as built: its controller samples every {every}{usual}")


def mention_unstable_loop(stage: Stage) -> None:
    """Log that the loop of a stage is unstable, if it is.

    The logger "friso" reports this before work that may take minutes and whose answer depends on stability.
    """
    from friso.hunting import unstable
    from friso.shown.text import unstable_loop

    for sentence in unstable_loop(unstable(stage)):
        note(sentence.removesuffix("."), meanwhile=True)


def correlations_of(source: StageLike, stage: Stage) -> Correlations:
    """Return the correlations of uncertain keys, from a file beside the stage file.

    Without such a file, there are none. Raises InputError for a file that cannot be read or used.
    """
    correlations = Correlations()
    if not isinstance(source, Stage | Mapping) and correlations_file(Path(source)).exists():
        correlations = read_correlations(correlations_file(Path(source)), load(source))
    return correlations.among(stage.uncertain())


_LONGEST_STEM = 150
"""Longest part [bytes] of another file's name that is used in names of written files."""


def stem_of(source: StageLike) -> str:
    """Return a stem for names of files about a stage: the name of its file without suffix.

    The stem of a stage without a file is "stage". Bytes that are not text become "_". A long name is cut, so that
    suffixes still fit.
    """
    if isinstance(source, Stage | Mapping):
        return "stage"
    return re.sub("[\ud800-\udfff]", "_", Path(source).stem).encode()[:_LONGEST_STEM].decode(errors="ignore")


def tolerance_of(value: str | float) -> float:
    """Read a relative tolerance of the solver.

    Raises InputError unless it is a number from 1e-12 to 1e-2.
    """
    from friso.engine.allowance import checked_rtol

    try:
        return checked_rtol(float(value))
    except ValueError:
        raise wrong("rtol", quoted(value), "a number from 1e-12 to 1e-2", "1e-6") from None


def text_of(value: str | float, unit: str) -> str:
    """Write a quantity as in a stage file: a text unchanged, a number with `unit` appended."""
    return value if isinstance(value, str) else exactly(value, unit)


def quantity_of(value: str | float, name: str, quantity: Quantity) -> float:
    """Convert a text with a unit, or a number in SI, to an SI value.

    Raises InputError, which names the option `name`, for a value that the `quantity` does not allow.
    """
    try:
        return float(quantity.read(text_of(value, quantity.unit)))
    except InputError as error:
        raise InputError(name, error.actual, error.expected, f"{name}={error.example}") from None


def with_tolerance(stage: Stage, within: LengthLike | None) -> Stage:
    """Return a stage that counts as in position `within` a deviation; None stands for its own.

    Raises InputError for a deviation that is not greater than 0, or more than a metre or radian.
    """
    if within is None:
        return stage
    length = Quantity("m", _AT_MOST_1, "5 um").on(stage.axis_kind)
    size = quantity_of(within, "within", length)
    return stage.replace({"tolerance.within": exactly(size, length.unit)})


def in_position(stage: Stage, within: LengthLike | None) -> float:
    """Return which deviation [m] of a stage counts as in position, by the option `within` or by its file.

    It is never finer than a step of the encoder, or than an error at which the controller exerts no force.
    """
    from friso.hunting.measures import bands_of

    return bands_of(with_tolerance(stage, within).flat())[0]


_AT_MOST_1 = Bound("greater than 0 and at most 1", lambda value: (value > 0) & (value <= 1))


def whole_number(value: int, name: str, least: int, most: int, example: str) -> int:
    """Check a whole number, and return it.

    Raises InputError for the option `name` unless the number lies from `least` to `most`.
    """
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not whole or not least <= value <= most:
        long = whole and abs(value) >= 10**18
        actual = "a number of many digits" if long else str(value) if whole else quoted(str(value))
        raise wrong(name, actual, f"a whole number from {least} to {most}", example)
    return value


def choice(value: str, name: str, choices: Sequence[str], example: str) -> str:
    """Check that a value is one of `choices`, and return it.

    Raises InputError for the option `name` otherwise.
    """
    if not (isinstance(value, str) and value in choices):
        raise InputError(
            name, quoted(value), choices[0] if len(choices) == 1 else f"one of {', '.join(choices)}", example
        )
    return value


def pairs_of(values: Changes, name: str, example: str) -> dict[str, str]:
    """Return texts by key, from a dictionary or texts KEY=VALUE.

    Raises InputError for anything else, and for a key that occurs twice.
    """
    if isinstance(values, Mapping):
        for key, value in values.items():
            if not isinstance(value, str):
                of_key, _, text = example.partition("=")
                raise wrong(name, f"{quoted(value)} for {quoted(key)}", "a text", f'{{"{of_key}": {text}}}')
        return dict(values)
    pairs: dict[str, str] = {}
    for text in values or ():
        if not isinstance(text, str):
            raise wrong(name, quoted(text), "KEY=VALUE", example)
        key, equals, value = text.partition("=")
        key = key.strip()
        if not (equals and key and value.strip()):
            raise wrong(name, text, "KEY=VALUE", example)
        if key in pairs:
            raise wrong(name, f"{key} given twice", "each key once", example)
        pairs[key] = value.strip()
    return pairs


def axes_of(axes: Mapping[str, Any], texts: Mapping[str, str | None], example: str) -> dict[str, Any]:
    """Collect axes from a dictionary and from texts KEY=RANGE, each key once.

    `texts` are by the name of their option. Raises InputError for a text of another form, and for a key that occurs
    twice.
    """
    every = dict(axes)
    for name, text in texts.items():
        ranges = {} if text is None else pairs_of([text], name, example)
        for key in ranges:
            if key in every:
                raise wrong(name, f"{key} given twice", "each key once", example)
        every |= ranges
    return every


def wrong(name: str, actual: str, expected: str, example: str) -> InputError:
    """Build the error for an option, named by its keyword; the command line says "--name" for it."""
    return InputError(name, actual, expected, f"{name}={example}")
