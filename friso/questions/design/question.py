"""Design an isolator that stops hunting, and try it in simulated moves.

Leaf springs, stroke, crossover and gains follow from a specification.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from friso.design_method.prepare import assumed, by_rules, check_designable, offset_points, outline
from friso.design_method.spec import Spec, load_spec, read_spec
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import AS_BUILT, Changes, FrequencyLike, StageLike
from friso.platform.installed import need
from friso.progress import Progress, silent
from friso.quantities import Quantity, positive
from friso.stage import Stage, numeric_keys

if TYPE_CHECKING:
    from friso.shown.blocks import Files


class DesignAnswer(Answer):
    """A design; `result` is a `Design`, or an `UnfinishedDesign`; ``answer.stage`` is the designed stage."""

    status = 2

    @property
    def failure(self) -> str:
        """Say which requirements are not met; empty if all are."""
        from friso.questions.design.words import shortfall

        if self.unfinished or self.result.meets:
            return ""
        return f"the design does not meet the specification: {shortfall(self.result)}"

    @property
    def unfinished(self) -> bool:
        """Tell whether the design was not verified, after Ctrl-C or because no isolator is needed."""
        from friso.design_method.method import UnfinishedDesign

        return isinstance(self.result, UnfinishedDesign)

    @property
    def interrupted(self) -> bool:
        """Tell whether the design was not verified because Ctrl-C ended the work."""
        return self.unfinished and self.result.interrupted

    def files(self) -> Files:
        """Return all files of a design; of an unfinished one, the stage so far is the only file."""
        from friso.questions.design.blocks import NOT_VERIFIED

        return {NOT_VERIFIED: self.result.stage.to_toml()} if self.unfinished else super().files()


@question
def design(
    stage: StageLike,
    spec: Spec | str | os.PathLike[str] | None = None,
    *,
    set: Changes = None,
    crossover: FrequencyLike | None = None,
    anyway: bool = False,
    progress: Progress = silent,
) -> DesignAnswer:
    """From a specification to leaf springs, stroke and controller that do not hunt: design.toml, and its reasons.

    Parameters
    ----------
    spec : path, optional
        The specification: crossover limit, friction, moves, load, space, sheets; default: one made from the stage.
    crossover : str or float, optional
        Crossover that can be reached, "20 Hz", in place of the limit in the specification.
    anyway : bool
        Design and try the isolator even if none is needed.

    Returns
    -------
    DesignAnswer
        The design with the numbers of every step, ``answer.stage``, ``answer.meets``.

    Raises
    ------
    InputError
        For a stage or a specification that is not usable.
    friso.design_method.method.NoDesign
        Where nothing meets the specification: with what to relax by how much.

    Examples
    --------
    >>> import friso
    >>> friso.design(friso.example("thesis_rig"), friso.example("specs/thesis"))  # doctest: +SKIP
    """
    need("design", "friso design")
    chosen = inputs.read_stage(stage, set, leaves_out=AS_BUILT[1:])
    check_designable(chosen)
    specification = specification_of(chosen, spec)
    if crossover is not None:
        specification = specification.with_limit(
            inputs.quantity_of(crossover, "crossover", Quantity("Hz", positive, "20 Hz"))
        )
    _tell_what_is_assumed(chosen, specification, spec is None)
    inputs.mention_unstable_loop(chosen)
    if chosen.drive:
        inputs.note("[drive] is taken into account for the margins; hunting and moves are simulated in continuous time")
    from friso.design_method.method import DesignInterrupted, NotNeeded
    from friso.design_method.method import design as designed

    try:
        return DesignAnswer(designed(chosen, specification, progress, anyway))
    except (DesignInterrupted, NotNeeded) as ended:
        return DesignAnswer(ended.so_far)


def specification_of(stage: Stage, spec: Spec | str | os.PathLike[str] | None) -> Spec:
    """Return the specification from a file or an object; without one, make it from the stage.

    Raises InputError for a file that is no specification.
    """
    if spec is None:
        return read_spec(outline(stage))
    return spec if isinstance(spec, Spec) else load_spec(Path(spec))


def _tell_what_is_assumed(stage: Stage, spec: Spec, outlined: bool) -> None:
    """Warn about everything that neither stage file nor specification states.

    `outlined` is true if there is no specification and one was made from the stage.
    """
    from friso.equations.bandwidth import bandwidth
    from friso.shown.text import with_unit

    if outlined:
        made = "friso init --spec STAGE.toml writes it for you to edit"
        inputs.note(f"no specification: one is made from the stage file; {made}")
    rules = by_rules(stage)
    if rules is not stage:
        hertz = with_unit(bandwidth(rules.flat()), "Hz")
        inputs.note(
            f"the design is that of a PID by van Dijk's rules (alpha = 0.1, beta = 2) in the place of the stage file's "
            f"controller, with its bandwidth when the joint is locked, {hertz}; friso export lists its gains"
        )
    if offset := offset_points(stage, spec):
        inputs.note(
            f"actuator and sensor are taken {with_unit(float(spec.leaves.offset), 'm')} off the middle of the leaves' "
            f"width, so that they see it turn: state [leaves] offset, or {', '.join(offset)}, to have another"
        )
    if keys := assumed(stage, spec):
        units = numeric_keys(stage.flat() | keys)
        numbers = ", ".join(f"{key} = {with_unit(value, units[key].unit)}" for key, value in keys.items())
        inputs.note(f"the stage file has no joint: {numbers} are assumed; state [masses] and [joint] to have others")
