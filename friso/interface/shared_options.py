"""Declare once the parameters that several questions share.

They appear in docstrings and in the help of commands. A function names such a parameter in its signature and leaves it
out of its docstring; `described` adds it.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class SharedOption:
    """The type and meaning of a shared parameter in docstrings.

    The line in a command's help is given if it differs from the docstring.
    """

    kind: str
    meaning: str
    help: str = ""


SHARED: Mapping[str, SharedOption] = {
    "stage": SharedOption("Stage, path or dict", "The stage, its file, or the tables of one.", "The stage file."),
    "set": SharedOption(
        "dict, optional",
        'Keys to override, ``{"joint.locked": True}``.',
        'Override a key: masses.stage="0.6 kg"; a number alone has the unit that the file has there.',
    ),
    "progress": SharedOption("Progress", "Called as work is done, also from worker threads."),
    "rtol": SharedOption("float", "Relative tolerance of the solver, 1e-12 to 1e-2."),
    "seed": SharedOption("int", "Seed of the draws: the same seed gives the same machines."),
    "within": SharedOption(
        "str or float, optional",
        'Deviation that counts as in position, "5 um" or a number [m]; default: that of [tolerance], or 1 um. It is '
        "never finer than a step of the encoder, or than an error at which the controller exerts no force.",
    ),
    "logs": SharedOption("path or list of paths", "Log files; friso logs --help lists their formats."),
    "map": SharedOption(
        "dict, optional", 'Roles and their channels: ``{"position": "Axis1.ActPos"}``.', 'position="Axis1.ActPos"'
    ),
    "unit": SharedOption(
        "dict, optional", 'Channels and their units: ``{"Axis1.ActPos": "mm"}``.', 'Axis1.ActPos="mm"'
    ),
    "scale": SharedOption("dict, optional", 'Roles and their scales: ``{"force": "35.15 N/V"}``.', 'force="35.15 N/V"'),
    "dt": SharedOption("str or float, optional", 'Sample time, "1 ms" or a number [s], if a file does not contain it.'),
    "axis": SharedOption("str, optional", '"rotary" for angles, torques and moments of inertia.'),
}
"""The shared parameters by name."""


def described(function: Callable[..., Any]) -> str:
    """Return the docstring of a function with an entry for every parameter in order.

    Raises TypeError for a parameter that is neither in the docstring nor shared.
    """
    text = inspect.getdoc(function) or ""
    before, own, after = _parts(text)
    entries, lines = {name: block for names, block in own for name in names}, []
    for name in inspect.signature(function).parameters:
        block = entries.get(name)
        if block is None:
            if name not in SHARED:
                raise TypeError(f"the docstring of {function.__name__} does not describe {name}")
            block = f"{name} : {SHARED[name].kind}\n    {SHARED[name].meaning}"
        if block not in lines:
            lines.append(block)
    return "\n".join([before.rstrip(), "", "Parameters", "----------", *lines, "", after])


def meaning(function: Callable[..., Any], name: str) -> str:
    """Return the text of a parameter in a command's help.

    The text is the first paragraph of the parameter's description, without mentions of SI numbers, since a command line
    takes texts with units.
    """
    own = {parameter: block for names, block in _parts(function.__doc__ or "")[1] for parameter in names}
    shared = SHARED.get(name)
    if shared is not None and shared.help and own[name].endswith(shared.meaning):
        return shared.help
    _, _, lines = own[name].partition("\n")
    text = " ".join(lines.partition("\n\n")[0].split()).replace("``", "").replace("`", "")
    return re.sub(r",? or (a number|two numbers) \[[^][]*\]", "", text)


def _parts(text: str) -> tuple[str, list[tuple[list[str], str]], str]:
    """Split a docstring into the part before its parameters, their entries, and the part behind."""
    match = re.search(r"^Parameters\n-+\n", text, re.MULTILINE)
    following = re.search(r"^\w+\n-+\n", text[match.end() if match else 0 :], re.MULTILINE)
    start = match.start() if match else (following.start() if following else len(text))
    first = match.end() if match else start
    last = (first if match else 0) + following.start() if following else len(text)
    return text[:start], [*_entries(text[first:last] if match else "")], text[last:]


def _entries(text: str) -> Iterator[tuple[list[str], str]]:
    """Yield the entries of a docstring's parameters: the names ("only, keep") and the lines."""
    for block in re.split(r"\n(?=\w)", text.strip("\n")):
        if block:
            yield [name.strip() for name in block.partition(":")[0].split(",")], block.rstrip()
