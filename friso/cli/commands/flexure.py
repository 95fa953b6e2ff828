"""`friso flexure`: what the leaf springs of a joint are worth: stiffness, modes, stress."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.command import Command
from friso.cli.common import AsJson, Overrides, StageFile, leave, print_answer, read_stage, say
from friso.cli.output import OutFolder, Overwrite, output_folder, print_document, print_written
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.quantities import Quantity, positive, quoted
from friso.stage import Stage

if TYPE_CHECKING:
    from friso.leaf_springs.both_models import BothModels
    from friso.leaf_springs.mechanism import Mechanism

STROKE = Quantity("m", positive, "1 mm")
EXAMPLE = """[flexure]
            leaves = 2
            length = "70 mm"
            width = "45 mm"
            thickness = "0.35 mm"
            spacing = "60 mm"
            material = "stainless 1.4310\""""


def flexure(
    stage_file: StageFile,
    stroke: Annotated[
        str | None, typer.Option(metavar='"LENGTH"', help="Deflection to one side; default: joint.stroke.")
    ] = None,
    overrides: Overrides = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """What are the leaf springs of a joint worth: stiffness, modes, stress, fatigue and buckling, and a drawing.

    Example: friso flexure rig.toml --stroke "1 mm" --out flexure
    """
    stage = read_stage(stage_file, overrides, leaves_out=())
    mechanism = _mechanism(stage, str(stage_file))
    deflection = _stroke(stroke, stage, mechanism)
    from friso.leaf_springs.both_models import both_models

    target = output_folder("flexure", out, overwrite, [stage_file])
    files = []
    with ProgressBar("bending the leaves") as progress:
        evaluated = both_models(stage, mechanism, deflection)
        if target is not None:
            from friso.views.flexure.page import flexure_files

            files = target.write(flexure_files(evaluated), progress)
    if as_json:
        from friso.views.flexure.document import flexure_document

        print_document(flexure_document(evaluated), files)
    else:
        _print(evaluated)
        print_written(files)
    if evaluated.failure:
        say(f"the beam model found no solution: {evaluated.failure}")
    leave(not evaluated.failure)


def _mechanism(stage: Stage, origin: str) -> Mechanism:
    """The leaf springs of the stage. Raises InputError without [flexure]."""
    from friso.leaf_springs.mechanism import Mechanism

    if stage.flexure is None:
        expected = "a table of leaf springs, from which joint.stiffness and [parasitic] follow (leave these out)"
        raise InputError("flexure", "no [flexure]", expected, EXAMPLE, origin)
    return Mechanism.of(stage.flat())


def _stroke(text: str | None, stage: Stage, mechanism: Mechanism) -> float:
    """The stroke [m], of the option or else of the joint, which leaves can bend by. Raises InputError."""
    key, example = ("joint.stroke", 'stroke = "1 mm"') if text is None else ("--stroke", '--stroke "1 mm"')
    if text is None:
        stroke = stage.joint and stage.joint.stroke
        if stroke is None:
            raise InputError("--stroke", "nothing", "the stroke, because the joint has none", '--stroke "1 mm"')
    else:
        try:
            stroke = STROKE.read(text)
        except InputError as error:
            raise InputError(key, error.actual, error.expected, example) from None
    if stroke > mechanism.length / 2:
        expected = f"at most half the length of the leaves, {1e3 * mechanism.length / 2:g} mm"
        raise InputError(key, quoted(getattr(stroke, "text", stroke)), expected, example)
    return float(stroke)


def _print(evaluated: BothModels) -> None:
    from friso.views.flexure.table import rows
    from friso.views.flexure.words import sentences

    print_answer(sentences(evaluated), evaluated.stage.name, list(evaluated.models), rows(evaluated))


COMMAND = Command(flexure, 70)
