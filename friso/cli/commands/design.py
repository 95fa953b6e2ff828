"""`friso design`: from a specification to leaf springs, stroke, crossover and gains, tried in simulated moves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from friso.cli.asking import Details, ask
from friso.cli.command import STOPS, Command
from friso.cli.common import AsJson, Overrides, StageFile, say
from friso.cli.output import DefaultFolder, Overwrite, print_document

if TYPE_CHECKING:
    from friso.design_method.method import NoDesign


def design(
    stage_file: StageFile,
    spec_file: Annotated[
        Path | None,
        typer.Argument(metavar="SPEC.toml", help="The specification; one from the stage file if left out."),
    ] = None,
    overrides: Overrides = None,
    laws: Annotated[
        bool, typer.Option("--laws", help="Take the worst edge over all friction laws that keep what is measured.")
    ] = False,
    out: DefaultFolder = Path("design"),
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    details: Details = False,
) -> None:
    """From a specification to leaf springs, stroke and controller that do not hunt: design.toml, and its reasons.

    Example: friso design examples/thesis_rig.toml examples/specs/thesis.toml --out design
    """
    from friso.design_method.method import NoDesign
    from friso.questions.design.question import STAGES
    from friso.questions.design.question import design as question

    shown = {"out": out, "overwrite": overwrite, "as_json": as_json, "details": details}
    try:
        ask("design", question, stage_file, spec_file, set=overrides, laws=laws, **shown, writes=STAGES)
    except NoDesign as failure:
        _refuse(failure, stage_file, spec_file, as_json)


def _refuse(failure: NoDesign, stage_file: Path, spec_file: Path | None, as_json: bool) -> NoReturn:
    """Say why there is no design, and leave."""
    from friso.questions.design.document import refused_document
    from friso.questions.design.question import specification_of
    from friso.questions.design.words import refusal
    from friso.stage import load

    if as_json:
        stage = load(stage_file)
        print_document(refused_document(stage.name, specification_of(stage, spec_file).name, failure))
    say(refusal(failure))
    raise typer.Exit(2)


COMMAND = Command(design, 80, STOPS)
