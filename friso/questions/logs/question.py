"""Show what log files hold, before anything is identified."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from friso.errors import InputError
from friso.identification.logs.roles import from_options
from friso.identification.sources import LogContent, log_content
from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, ChannelUnits, KindName, Roles, RoleScales, TimeLike, text_of
from friso.progress import Progress, silent

if TYPE_CHECKING:
    from friso.shown.blocks import Files
    from friso.shown.pages import Report


LogFiles = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]
"""A file of logs, or several."""


class LogsAnswer(Answer):
    """Contents of log files.

    `result` has a `LogContent` for each file that could be read. `errors` says what is wrong with the others.
    """

    status = 2
    errors: Sequence[InputError]

    @property
    def failure(self) -> str:
        """Say what is wrong with the files that cannot be read; empty if all can."""
        return str(unreadable(self.errors)) if self.errors else ""

    def page(self) -> Report:
        """Return the page, named after the files."""
        return replace(super().page(), name=", ".join(content.path.name for content in self.result))

    def files(self) -> Files:
        """Return the page with its figures; nothing if no file could be read."""
        return super().files() if self.result else {}


def options_of(
    map: Changes,
    unit: Changes,
    scale: Changes,
    dt: str | float | None,
    kind: str | None = None,
    axis: str | None = None,
) -> Any:
    """Return what the user said of channels: roles, units, scales, kind of log and axis.

    `map`, `unit` and `scale` are dictionaries or texts KEY=VALUE, and `dt` is the sample time, a text or a number [s].
    Raises LogError for a text that cannot be read.
    """
    roles, units, scales = (
        [f"{key}={text}" for key, text in item.items()] if isinstance(item, Mapping) else item or ()
        for item in (map, unit, scale)
    )
    return from_options(roles, units, scales, None if dt is None else text_of(dt, "s"), kind, axis)


def paths_of(logs: LogFiles) -> list[Path]:
    """Return the paths of one file or of several."""
    return [Path(logs)] if isinstance(logs, str | os.PathLike) else [Path(log) for log in logs]


@question
def logs(
    logs: LogFiles,
    *,
    map: Roles = None,
    unit: ChannelUnits = None,
    scale: RoleScales = None,
    dt: TimeLike | None = None,
    axis: KindName | None = None,
    folder: Path | None = None,
    partly: bool = False,
    progress: Progress = silent,
) -> LogsAnswer:
    """What log files hold: channels, units, rates, ranges and small plots, and the role that friso gives each channel.

    Parameters
    ----------
    folder : Path, optional
        Where what was said of channels is kept, if not beside the logs.
    partly : bool
        Whether files that cannot be read are left to `errors` of the answer, instead of being raised.

    Returns
    -------
    LogsAnswer
        What each file holds.

    Raises
    ------
    InputError
        For a file that cannot be read.

    Examples
    --------
    >>> import friso
    >>> friso.logs("log.csv", map={"position": "ActPos"})  # doctest: +SKIP
    """
    options, files = options_of(map, unit, scale, dt, axis=axis), paths_of(logs)
    contents: list[LogContent] = []
    wrong: list[InputError] = []
    for number, path in enumerate(files):
        progress(number, len(files), path.name)
        try:
            contents.append(log_content(path, options, folder))
        except InputError as error:
            wrong.append(error)
    answer = LogsAnswer(contents, errors=wrong)
    if wrong and not partly:
        raise unreadable(wrong)
    return answer


def unreadable(errors: Sequence[InputError]) -> InputError:
    """Join the errors of all unreadable files into one error."""
    return errors[0] if len(errors) == 1 else InputError("", "\n\n".join(map(str, errors)), "files that can be read")
