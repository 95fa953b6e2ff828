"""Provide what users start from.

These are a stage file to edit, the examples, and the schemas by which editors complete files.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from friso.errors import InputError
from friso.interface.inputs import LOGGER, Changes, changes_of, choice
from friso.interface.output_folder import check_file, write_file
from friso.stage import load
from friso.stage.arguments import check_arguments

EXAMPLES = "examples"


def examples_folder() -> Path:
    """Return the folder of the examples: in the installed package, or beside it in the repository."""
    package = Path(str(files("friso")))
    return next(folder for folder in (package / EXAMPLES, package.parent / EXAMPLES) if folder.is_dir())


def example_names() -> list[str]:
    """Return the names of the examples that come with friso.

    Names of specifications begin with "specs/"; names of drives' parameter files begin with "drives/" and keep their
    suffix.
    """
    return sorted(_examples())


def _examples() -> dict[str, Path]:
    """Return the paths of the examples by name."""
    folder = examples_folder()
    named = {path.relative_to(folder): path for path in folder.rglob("*.*") if path.suffix in (".toml", ".ini")}
    return {(name.with_suffix("") if name.suffix == ".toml" else name).as_posix(): path for name, path in named.items()}


@check_arguments
def example(name: str) -> Path:
    """The path of an example that comes with friso.

    Parameters
    ----------
    name : str
        Its name, "thesis_rig", "specs/thesis" or "drives/linuxcnc_torque_axis.ini"; a wrong one is answered with all
        of them.

    Returns
    -------
    Path
        A stage file, the specification of a design, or the parameters of a drive.

    Raises
    ------
    InputError
        For an unknown name.

    Examples
    --------
    >>> import friso
    >>> friso.load(friso.example("thesis_rig")).name
    'Thesis rig'
    """
    stem = name.removesuffix(".toml").removeprefix("examples/")
    return _examples()[choice(stem, "NAME", example_names(), "friso example thesis_rig")]


@check_arguments
def init(
    path: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    *,
    spec: str | os.PathLike[str] | None = None,
    from_: str | os.PathLike[str] | None = None,
    axis: str | None = None,
    set: Changes = None,
) -> Path:
    """Write a stage file to start from, or a specification for the design of a stage.

    The stage file is a commented one, or that of an axis in a drive's parameter file.

    Parameters
    ----------
    path : path, optional
        The file to write; default: "stage.toml", or "spec.toml".
    overwrite : bool
        Whether a file of that name may be replaced.
    spec : path, optional
        The stage file of which a specification is written instead.
    from_ : path, optional
        The parameter file of a drive, such as a LinuxCNC INI. What it has and the stage leaves out is mentioned.
    axis : str, optional
        Which axis of that file, where it has several.
    set : dict, optional
        What that file does not tell, of the machine above all.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        Where there is a file already, or none can be written.

    Examples
    --------
    >>> import friso, tempfile, pathlib
    >>> friso.load(friso.init(pathlib.Path(tempfile.mkdtemp(), "my_stage.toml"))).name
    'My stage'
    """
    place = Path(path or ("stage.toml" if spec is None else "spec.toml"))
    values = changes_of(set)
    if from_ is None and (axis is not None or values):
        key = "set" if values else "axis"
        raise InputError(key, "no --from", "a parameter file that it is about", "--from machine.ini")
    check_file("STAGE.toml", place, overwrite, [Path(source) for source in (spec, from_) if source is not None])
    write_file("STAGE.toml", place, _start(spec, from_, axis, values), overwrite)
    return place


def _start(
    spec: str | os.PathLike[str] | None,
    source: str | os.PathLike[str] | None,
    axis: str | None,
    values: Mapping[str, Any],
) -> str:
    """Return the text of a file to start from.

    The text is a specification for the stage file `spec`, the stage of an axis in the parameter file `source`, or the
    commented stage file. Raises InputError if both files are named, or one cannot be used.
    """
    if spec is not None and source is not None:
        raise InputError("spec", "together with --from", "one of the two", "friso init --from machine.ini")
    if spec is not None:
        from friso.design_method.prepare import outline

        return outline(load(spec))
    if source is None:
        return files("friso").joinpath("templates/stage.toml").read_text(encoding="utf-8")
    from friso.drives.read import stage_from

    stage_of_axis = stage_from(Path(source), axis, values)
    for sentence in stage_of_axis.left_out:
        LOGGER.warning(f"left out: {sentence}")
    return stage_of_axis.text()


@check_arguments
def schema(of: str = "stage") -> dict[str, Any]:
    """The JSON Schema of the stage file, or of the specification of a design: keys, units, bounds, examples.

    Parameters
    ----------
    of : str
        "stage" or "specification".

    Returns
    -------
    dict
        A JSON Schema (draft 2020-12), by which editors complete and check the files.

    Raises
    ------
    InputError
        For anything else.

    Examples
    --------
    >>> import friso
    >>> friso.schema()["properties"]["masses"]["properties"]["cart"]["examples"]
    ['1.2 kg']
    """
    from friso.interface.schema import SCHEMAS

    return SCHEMAS[choice(of, "of", tuple(SCHEMAS), "of=stage")]()
