"""`friso boundary`: where hunting ends, over one key or in the plane of two."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.command import Command
from friso.cli.common import (
    AsJson,
    Overrides,
    StageFile,
    Tolerance,
    key_values,
    print_wrapped,
    read_stage,
    read_tolerance,
)
from friso.cli.output import OutFolder, Overwrite, output_folder, print_document, print_written
from friso.cli.progress import ProgressBar
from friso.quantities import Quantity, any_sign

if TYPE_CHECKING:
    from friso.hunting.boundary import KeyRange
    from friso.views.boundary.words import ShownKey

RANGE = 'KEY="FIRST..LAST"'


def boundary(
    stage_file: StageFile,
    x: Annotated[str, typer.Option(metavar=RANGE, help="The key over which cycles are followed.")],
    y: Annotated[str | None, typer.Option(metavar=RANGE, help="A second key: curves in the plane of both.")] = None,
    link: Annotated[
        list[str] | None, typer.Option(metavar="KEY=EXPRESSION", help='A key tied to others: masses.cart="0.7 * mass".')
    ] = None,
    log: Annotated[
        bool, typer.Option("--log", help="Make both ranges logarithmic; for a single one, append :log.")
    ] = False,
    overrides: Overrides = None,
    rtol: Tolerance = "1e-9",
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Where hunting ends: the values at which the hunting cycle stops attracting, over one key or two.

    Example: friso boundary rig.toml --set joint.locked=true --x controller.crossover="1 Hz..40 Hz" --out edge
    """
    stage, tolerance = read_stage(stage_file, overrides), read_tolerance(rtol)
    axes = key_values([("--x", x)] + ([("--y", y)] if y else []), '--x controller.crossover="1 Hz..40 Hz"')
    links = key_values([("--link", text) for text in link or []], '--link masses.cart="0.7 * mass"')
    target = output_folder("boundary", out, overwrite, [stage_file])
    from friso.studies.boundary import boundary as boundary_of

    files = []
    with ProgressBar(f"following cycles over {' and '.join(axes)}") as progress:
        traced = boundary_of(stage, axes, links, tolerance, log)
        keys = tuple(_printed(swept, text) for swept, text in zip(traced.space.ranges, axes.values(), strict=True))
        if target is not None:
            from friso.views.boundary.page import boundary_files

            files = target.write(boundary_files(traced, keys, stage.name, f"{stage_file.stem}_boundary"), progress)
    if as_json:
        from friso.views.boundary.document import boundary_document

        print_document(boundary_document(traced, keys), files)
    else:
        from friso.views.boundary.words import sentences

        for sentence in sentences(traced, keys):
            print_wrapped(sentence)
        print_written(files)


def _printed(swept: KeyRange, text: str) -> ShownKey:
    """A key in the unit in which its range was given, that of the last value."""
    from friso.views.boundary.words import ShownKey

    match = re.search(r"\.\.\s*[-+.\deE]*\s*([^:]*)", text)
    unit = match[1].strip() if match else ""
    return ShownKey(swept.key, unit, Quantity(swept.unit, any_sign, "").factor(unit)) if unit else ShownKey(swept.key)


COMMAND = Command(boundary, 60)
