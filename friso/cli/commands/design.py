"""`friso design`: from a specification to leaf springs, stroke, crossover and gains, tried in simulated moves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from friso.cli.command import Command
from friso.cli.common import (
    AS_BUILT,
    AsJson,
    Overrides,
    StageFile,
    print_wrapped,
    read_stage,
    say,
)
from friso.cli.output import DefaultFolder, OutputFolder, Overwrite, print_document
from friso.cli.progress import ProgressBar

STAGES = ("design.toml", "worst.toml")

if TYPE_CHECKING:
    from friso.design_method.method import Design, NoDesign
    from friso.design_method.spec import Spec
    from friso.stage import Stage


def design(
    stage_file: StageFile,
    spec_file: Annotated[
        Path | None,
        typer.Argument(metavar="SPEC.toml", help="The specification; one from the stage file if left out."),
    ] = None,
    overrides: Overrides = None,
    out: DefaultFolder = Path("design"),
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """From a specification to leaf springs, stroke and controller that do not hunt: design.toml, and why it is so.

    Example: friso design examples/thesis_rig.toml examples/specs/thesis.toml --out design
    """
    from friso.design_method.method import NoDesign
    from friso.design_method.outline import outline
    from friso.design_method.spec import load_spec, read_spec

    stage = read_stage(stage_file, overrides, leaves_out=AS_BUILT[1:])
    spec = read_spec(outline(stage)) if spec_file is None else load_spec(spec_file)
    _say_what_is_assumed(stage, spec, spec_file)
    if stage.drive:
        say("[drive] is taken into account for the margins; hunting and moves are simulated in continuous time")
    target = OutputFolder("design", out, overwrite, [file for file in (stage_file, spec_file) if file])
    target.check(STAGES)
    try:
        result, files = _designed(stage, spec, target)
    except NoDesign as failure:
        _refuse(failure, stage, spec, as_json)
    if as_json:
        from friso.views.design.document import design_document

        print_document(design_document(result), files)
    else:
        _print(result, files)
    if not result.meets:
        from friso.views.design.words import shortfall

        say(f"the design does not meet the specification: {shortfall(result)}")
        raise typer.Exit(2)


def _say_what_is_assumed(stage: Stage, spec: Spec, spec_file: Path | None) -> None:
    """Say what neither the stage file nor a specification tells."""
    from friso.design_method.prepare import assumed
    from friso.stage import numeric_keys
    from friso.views.drawing.prefixes import with_unit

    if spec_file is None:
        say("no specification: one is made from the stage file; friso init --spec STAGE.toml writes it for you to edit")
    if keys := assumed(stage, spec):
        units = numeric_keys(stage.flat() | keys)
        numbers = ", ".join(f"{key} = {with_unit(value, units[key].unit)}" for key, value in keys.items())
        say(f"the stage file has no joint: {numbers} are assumed; state [masses] and [joint] to have others")


def _designed(stage: Stage, spec: Spec, target: OutputFolder) -> tuple[Design, list[Path]]:
    """The design and its files, with progress on a terminal. Raises InputError, NoDesign."""
    from friso.design_method.method import design as method
    from friso.views.design.page import design_files

    with ProgressBar() as progress:
        result = method(stage, spec, progress)
        return result, target.write(design_files(result), progress)


def _refuse(failure: NoDesign, stage: Stage, spec: Spec, as_json: bool) -> NoReturn:
    """Say why there is no design, and leave."""
    from friso.views.design.document import refused_document
    from friso.views.design.words import refusal

    if as_json:
        print_document(refused_document(stage.name, spec.name, failure))
    say(f"no design: {refusal(failure)}")
    raise typer.Exit(2)


def _print(result: Design, files: list[Path]) -> None:
    """The summary, step by step, and what to do next."""
    from friso.views.design.steps import steps
    from friso.views.design.words import headline

    for _, sentence in headline(result):
        print_wrapped(sentence)
    for number, step in enumerate(steps(result), 1):
        print(f"\n{number}. {step.title}")
        for sentence in step.sentences:
            print_wrapped(sentence, "   ")
    named, pictures = files[: len(STAGES) + 2], files[len(STAGES) + 2 :]
    figures = len({path.stem for path in pictures})
    print(f"\nwrote {', '.join(map(str, named))}, and {figures} figures as PNG, SVG and PDF")
    print(f"next: friso check {files[0]}")


COMMAND = Command(design, 80)
