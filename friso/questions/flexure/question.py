"""Evaluate the leaf springs of a joint: stiffness, modes and stress."""

from __future__ import annotations

from collections.abc import Mapping

from friso.errors import InputError
from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, LengthLike, StageLike, read_stage, text_of, wrong
from friso.leaf_springs.mechanism import Mechanism
from friso.platform.installed import need
from friso.progress import Progress, silent
from friso.quantities import Quantity, positive, quoted
from friso.stage import Stage

STROKE = Quantity("m", positive, "1 mm")
EXAMPLE = """[flexure]
            leaves = 2
            length = "70 mm"
            width = "45 mm"
            thickness = "0.35 mm"
            spacing = "60 mm"
            material = "stainless 1.4310\""""


class FlexureAnswer(Answer):
    """The leaf springs of a joint; `result` holds the evaluations by beams and by closed forms."""

    @property
    def failure(self) -> str:
        """Say why the beam model found no solution; empty if it found one."""
        return f"the beam model found no solution: {self.result.failure}" if self.result.failure else ""


@question
def flexure(
    stage: StageLike, stroke: LengthLike | None = None, *, set: Changes = None, progress: Progress = silent
) -> FlexureAnswer:
    """How good are the leaf springs of a joint: stiffness, modes, stress, fatigue and buckling, with a drawing.

    Parameters
    ----------
    stroke : str or float, optional
        Deflection to one side, "1 mm" or a number [m]; default: `joint.stroke`.

    Returns
    -------
    FlexureAnswer
        Evaluations by geometrically exact beams and by closed forms: ``answer.best``, ``answer.models``.

    Raises
    ------
    InputError
        For a stage without leaf springs, or a stroke that these cannot have.

    Examples
    --------
    >>> import friso
    >>> friso.flexure(friso.example("thesis_leaves"))  # doctest: +SKIP
    """
    chosen = read_stage(stage, set, leaves_out=())
    mechanism = _mechanism(chosen, "" if isinstance(stage, Stage | Mapping) else str(stage))
    deflection = _stroke(stroke, chosen, mechanism)
    need("design", "friso flexure")
    progress(0, 0, "bending the leaves")
    from friso.leaf_springs.beams import both_models

    return FlexureAnswer(both_models(chosen, mechanism, deflection))


def _mechanism(stage: Stage, origin: str) -> Mechanism:
    """Return the leaf springs of the stage.

    Raises InputError, which names the stage's `origin`, for a stage without [flexure].
    """
    if stage.flexure is None:
        expected = "a table of leaf springs, from which joint.stiffness and [parasitic] follow (leave these out)"
        raise InputError("flexure", "no [flexure]", expected, EXAMPLE, origin)
    return Mechanism.of(stage.flat())


def _stroke(entry: str | float | None, stage: Stage, mechanism: Mechanism) -> float:
    """Return the stroke [m] of the option, or of the joint.

    Raises InputError for a missing stroke, or one of more than half the leaves' length.
    """
    if entry is None:
        stroke = stage.joint and stage.joint.stroke
        if stroke is None:
            raise wrong("stroke", "nothing", "the stroke, because the joint has none", '"1 mm"')
    else:
        try:
            stroke = STROKE.read(text_of(entry, "m"))
        except InputError as error:
            raise wrong("stroke", error.actual, error.expected, '"1 mm"') from None
    if stroke > mechanism.length / 2:
        expected = f"at most half the length of the leaves, {1e3 * mechanism.length / 2:g} mm"
        actual = quoted(getattr(stroke, "text", stroke))
        if entry is None:
            raise InputError("joint.stroke", actual, expected, 'stroke = "1 mm"')
        raise wrong("stroke", actual, expected, '"1 mm"')
    return float(stroke)
