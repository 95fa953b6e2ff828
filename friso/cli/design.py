"""`friso design`: from a specification to leaf springs, stroke, crossover and gains, tried in simulated moves."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from friso.cli.common import (
    AS_BUILT,
    AsJson,
    Overrides,
    StageFile,
    check_place,
    made_folder,
    print_wrapped,
    read_stage,
    say,
)
from friso.cli.progress import step_bar

if TYPE_CHECKING:
    from friso.design.method import Design, NoDesign, Progress
    from friso.design.spec import Spec
    from friso.stage import Stage

STAGES = ("design.toml", "worst.toml")
PAGE = "design.html"


def design(
    stage_file: StageFile,
    spec_file: Annotated[Path, typer.Argument(metavar="SPEC.toml", help="The specification.")],
    overrides: Overrides = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files written.")] = Path("design"),
    as_json: AsJson = False,
) -> None:
    """From a specification to leaf springs, stroke and controller that do not hunt: design.toml, and why it is so.

    Example: friso design examples/thesis_rig.toml examples/specs/thesis.toml --out design
    """
    from friso.design.method import NoDesign
    from friso.design.spec import load_spec

    stage = read_stage(stage_file, overrides, leaves_out=AS_BUILT[1:])
    spec = load_spec(spec_file)
    if stage.drive:
        say("[drive] is taken into account for the margins; hunting and moves are simulated in continuous time")
    check_place(out, STAGES, PAGE, (stage_file, spec_file))
    try:
        found, files = _designed(stage, spec, out)
    except NoDesign as failure:
        _refuse(failure, stage, spec, as_json)
    if as_json:
        from friso.views.design.document import design_document

        print(json.dumps(design_document(found) | {"files": [str(file) for file in files]}, allow_nan=False))
    else:
        _print(found, files)
    if not found.meets:
        from friso.views.design.words import shortfall

        say(f"the design does not meet the specification: {shortfall(found)}")
        raise typer.Exit(2)


def _designed(stage: Stage, spec: Spec, out: Path) -> tuple[Design, list[Path]]:
    """The design and its files, with progress on a terminal. Raises InputError, NoDesign."""
    from friso.design.method import design as method

    with step_bar() as bar:

        def progress(what: str, done: int, total: int) -> None:
            if bar:
                bar(done, total, what)

        found = method(stage, spec, progress)
        return found, _write(found, made_folder(out), progress)


def _write(found: Design, folder: Path, progress: Progress) -> list[Path]:
    """The stages, the page, the drawing, and every figure in all formats."""
    from friso.stage.files import save as save_stage
    from friso.views.design.figures import design_figures
    from friso.views.design.page import design_html, drawing
    from friso.views.drawing.matplotlib_renderer import FORMATS, save

    figures = design_figures(found)
    page, sheet = folder / PAGE, folder / "design_drawing.svg"
    page.write_text(design_html(found, figures), encoding="utf-8", newline="\n")
    sheet.write_text(drawing(found), encoding="utf-8", newline="\n")
    stages = [folder / name for name in STAGES]
    for path, stage in zip(stages, (found.stage, found.verification.worst), strict=True):
        save_stage(stage, path, overwrite=True)
    pictures = {folder / f"{figure.name}.{form}": figure for figure in figures for form in FORMATS}
    for number, (path, figure) in enumerate(pictures.items()):
        progress("figures", number, len(pictures))
        save(figure, path)
    return [*stages, page, sheet, *pictures]


def _refuse(failure: NoDesign, stage: Stage, spec: Spec, as_json: bool) -> NoReturn:
    """Say why there is no design, and leave."""
    from friso.views.design.document import refused_document
    from friso.views.design.words import refusal

    if as_json:
        print(json.dumps(refused_document(stage.name, spec.name, failure), allow_nan=False))
    say(f"no design: {refusal(failure)}")
    raise typer.Exit(2)


def _print(found: Design, files: list[Path]) -> None:
    """The summary, step by step, and what to do next."""
    from friso.views.design.steps import steps
    from friso.views.design.words import headline

    for _, sentence in headline(found):
        print_wrapped(sentence)
    for number, step in enumerate(steps(found), 1):
        print(f"\n{number}. {step.title}")
        for sentence in step.sentences:
            print_wrapped(sentence, "   ")
    named, pictures = files[: len(STAGES) + 2], files[len(STAGES) + 2 :]
    figures = len({path.stem for path in pictures})
    print(f"\nwrote {', '.join(map(str, named))}, and {figures} figures as PNG, SVG and PDF")
    print(f"next: friso check {files[0]}")
