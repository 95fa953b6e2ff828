"""Load and save stage files."""

from __future__ import annotations

import os
from pathlib import Path

from friso.errors import InputError
from friso.platform import files
from friso.platform.files import whole_file
from friso.platform.system import check_free
from friso.stage.arguments import check_arguments
from friso.stage.stage import Stage
from friso.stage.tables_of_files import read_stage, reason_of, stage_of


@check_arguments
def load(path: str | os.PathLike[str]) -> Stage:
    """Return the stage of the TOML file at `path`. Raises StageError.

    Examples
    --------
    >>> import friso
    >>> friso.load(friso.example("thesis_rig")).joint.stiffness.text
    '2.4 N/mm'
    """
    return read_stage(path)


@check_arguments
def loads(text: str, origin: str = "stage file") -> Stage:
    """Return the stage of a TOML text; `origin` names it in errors. Raises StageError.

    Examples
    --------
    >>> import friso
    >>> stage = friso.load(friso.example("thesis_rig"))
    >>> friso.loads(stage.to_toml()) == stage
    True
    """
    return stage_of(text, origin)


@check_arguments
def save(stage: Stage, path: str | os.PathLike[str], overwrite: bool = False) -> None:
    """Write a stage file to `path`, all of it or nothing.

    A file that is overwritten keeps its permissions, a link to it stays. Raises InputError where there is a file
    already (unless `overwrite`), or one that is read-only, or the place cannot be written to.

    Examples
    --------
    >>> import friso
    >>> stage = friso.load("rig.toml").replace({"masses.stage": "0.6 kg"})  # doctest: +SKIP
    >>> friso.save(stage, "heavier.toml")  # doctest: +SKIP
    """
    place = Path(path)
    if why := files.unwritable(place):
        raise InputError("path", *why, 'path="stage.toml"')
    if os.path.lexists(place) and not (overwrite and place.is_file()):
        raise InputError("", "a file that already exists", "a new file, or overwrite=True", origin=str(place))
    place = Path(os.path.realpath(place))  # write through a link, so that the link stays
    try:
        if place.exists():
            check_free(place)
        with whole_file(place, new=not overwrite, kept=True) as file:
            file.write(stage.to_toml().encode())
    except OSError as error:
        raise InputError("", reason_of(error), "a writable location", origin=str(place)) from error
