"""Turn a parameter file into a stage file.

Others wrote the text, so its size is limited and no value is trusted unchecked.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from friso.drives.ask import Ask, moving_mass
from friso.drives.drive import FORMATS, AsStage, AxisParameters, DriveFormat
from friso.errors import InputError, one_line, shortened
from friso.platform.files import flaw_of
from friso.quantities import quoted
from friso.stage import Stage
from friso.stage.rig import CONVERSIONS
from friso.stage.tables_of_files import text_of


@dataclass(frozen=True)
class StageOfAxis:
    """A stage read from a parameter file, with where it came from.

    Fields are the file's path and kind, the name of the axis, and sentences on what the stage leaves out.
    """

    stage: Stage
    path: Path
    kind: DriveFormat
    axis: str
    left_out: tuple[str, ...]

    def text(self) -> str:
        """Return the stage file, which begins with comments on its mass and on what was left out."""
        sentences = [f"From {self.path.name}, {self.axis}, by friso init --from."]
        if self.stage.transmission is None:
            sentences.append(f"[masses] is not in the drive's file: enter {moving_mass(self.stage.axis_kind)}")
        sentences += [f"Left out: {sentence}" for sentence in self.left_out]
        return "\n".join([*(f"# {one_line(sentence)}" for sentence in sentences), self.stage.to_toml()])


def stage_from(path: Path, axis: str | None, user_answers: Mapping[str, Any]) -> StageOfAxis:
    """Read one axis of a parameter file as a stage, completed by the user's answers.

    Raises InputError for a file that cannot be read. Values that are still missing are refused together.
    """
    kind, axes = read(path)
    chosen = _chosen(axes, axis, path)
    try:
        ask = Ask(user_answers)
        of_axis = kind.stage(chosen, ask)  # raises for unusable numbers before anything is asked
        ask.refuse_open(f"{path}, {chosen.name}")
        ask.refuse_unwanted()
        stage = _with_answers(of_axis, kind, chosen, path, user_answers)
    except InputError as error:
        raise error if error.origin else error.found_in(f"{path}, {chosen.name}") from None
    left = [*of_axis.left_out, *_silent_anti_windup(of_axis.tables["controller"])]
    return StageOfAxis(stage, path, kind, chosen.name, tuple(shortened(one_line(text)) for text in left))


def _silent_anti_windup(controller: Mapping[str, Any]) -> list[str]:
    """Say what is assumed of an integral at the limit of the force where neither file nor firmware states it."""
    integral = {"ki", "velocity_integral_time", "position_integral_time"} & controller.keys()
    if not integral or "force_limit" not in controller or "anti_windup" in controller:
        return []
    return ["what the integral does at the limit of the force: it is taken to rest there (controller.anti_windup)"]


def read(path: Path) -> tuple[DriveFormat, tuple[AxisParameters, ...]]:
    """Return the kind of a parameter file, and its axes that have gains.

    Raises InputError for a file of no known kind, or one that its kind cannot read.
    """
    titles = ", ".join(FORMATS[name].title for name in FORMATS)
    expected = f"a parameter file: {titles}"
    text = text_of(path, expected, "friso init stage.toml --from machine.ini", latin=True)
    for name in FORMATS:
        kind = FORMATS[name]
        if kind.recognises(text):
            try:
                return kind, kind.axes(kind.whole(text, lambda name: _beside(path, name)))
            except InputError as error:
                raise error.found_in(str(path)) from None
    raise InputError("", f"a file of another kind{_numbers_of(text)}", f"{expected}; {BY_HAND}", "", str(path))


BY_HAND = (
    'or by hand: friso init stage.toml, and in [controller] for a loop of P, I and D on the position kind = "pid" with '
    "kp = P F/L, ki = I F/(L T), kd = D F T/L (F: force of an output of 1, L: length of a unit of position, T: unit of "
    'time, the sample where gains are per sample); for a position loop above a velocity loop kind = "cascade" with kv '
    "in 1/s, kp = force per velocity, velocity_integral_time = kp/ki"
)
"""How to enter the gains of a file that no format reads."""

_NAME_OF_A_GAIN = r"[\w.\[\]]{0,80}(?:kp|ki|kd|kv|gain|prop|integ|deriv)\w{0,40}"
_GAIN = re.compile(rf"(?<![\w.])({_NAME_OF_A_GAIN})[\"' ]{{0,3}}[:=>, \t]{{1,9}}[\"']?(-?\d[\d.eE+-]{{0,20}})", re.I)
"""Pattern of what looks like a gain and its value."""


CHARACTERS_LOOKED_AT = 100_000
"""Longest part of a file of another kind that is looked at for gains. Parameter files have fewer characters."""

GAINS_SAID = 6
"""Largest number of what may be gains that is said of a file of another kind. More fill the screen."""


def _numbers_of(text: str) -> str:
    """Say which numbers of a text look like gains; "" for none."""
    numbers = dict(_GAIN.findall(text[:CHARACTERS_LOOKED_AT]))
    said = ", ".join(f"{one_line(name)} = {value}" for name, value in [*numbers.items()][:GAINS_SAID])
    return f", in which {said} may be gains" if said else ""


def _beside(path: Path, name: str) -> str | None:
    """Return the text of a file in the folder of another file, or below it.

    Returns None if the name leads outside that folder or to nothing. Raises InputError for a file that is no text.
    """
    place = None if flaw_of(name) else Path(os.path.realpath(path.parent / name))
    if place is None or not place.is_relative_to(os.path.realpath(path.parent)) or not os.path.lexists(place):
        return None
    return text_of(place, f"a text file, as {one_line(path.name)} names it", latin=True)


def _chosen(axes: tuple[AxisParameters, ...], name: str | None, path: Path) -> AxisParameters:
    """Return the axis with a name or letter; without a name, the only axis.

    Raises InputError if no axis, or more than one, fits.
    """
    names = ", ".join(f"{axis.name} ({axis.letter})" if axis.letter else axis.name for axis in axes)
    if name is None and len(axes) == 1:
        return axes[0]
    for axis in axes:
        if name in (axis.name, axis.letter or axis.name):
            return axis
    actual = f"{len(axes)} axes" if name is None else quoted(name)
    raise InputError("--axis", actual, f"one of {names}", f"--axis {axes[0].name}", str(path))


def _with_answers(
    of_axis: AsStage, kind: DriveFormat, axis: AxisParameters, path: Path, user_answers: Mapping[str, Any]
) -> Stage:
    """Build the stage from the tables of an axis, with the user's answers laid over them.

    Answers whose key has a dot are keys of the stage file. Friction model and motion get defaults. Raises InputError
    for an answer that is no key of a table, and for values that make no stage.
    """
    source = (
        f"Controller: {one_line(path.name)}, {axis.name}, by the formulas of {kind.firmware} ({kind.source}); "
        "machine: as given to friso init"
    )
    tables: dict[str, Any] = {"name": one_line(f"{path.stem}, {axis.name}"), "source": source}
    tables |= {name: dict(table) for name, table in of_axis.tables.items()}
    for key, value in user_answers.items():
        table, dot, name = key.partition(".")
        if dot:
            keys = tables.setdefault(table, {})
            if not isinstance(keys, dict):
                raise InputError(key, quoted(str(value)), "a key of a table of the stage", 'masses.stage="3 kg"')
            keys[name] = value
        elif key in CONVERSIONS:
            tables.setdefault("drive", {}).setdefault(key, value)  # a unit that the format has read keeps its name
    friction: dict[str, Any] = tables.get("friction", {})
    if friction.get("model") == "none":
        tables.pop("friction")
    elif friction:
        friction.setdefault("model", "lugre")
    motion: dict[str, Any] = tables.setdefault("motion", {})
    if motion.setdefault("kind", "there_and_back") == "there_and_back":
        motion.setdefault("return_at", "5 s")
        motion.setdefault("duration", "20 s")
    return Stage(**tables)
