"""Isolator or firmware: the same drawn machines with a joint, and with other settings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial

from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, FrequencyLike, LengthLike, Seed, SettingName, StageLike
from friso.progress import Progress, silent
from friso.quantities import Quantity, positive


class CompareAnswer(Answer):
    """Several options on the same machines; `result` is a `Comparison`."""

    @property
    def varied(self) -> Sequence[str]:
        """Return the keys over which machines are drawn."""
        return [*self.result.stage.uncertain()]

    @property
    def interrupted(self) -> bool:
        """Tell whether some options were not run."""
        return bool(self.result.not_run)

    @property
    def failure(self) -> str:
        """Say how many runs stopped early; empty if none did."""
        stopped = sum(result.failed for result in self.result.results)
        return f"{stopped} runs stopped early" if stopped else ""


@question
def compare(
    stage: StageLike,
    *,
    machines: int = 400,
    seed: Seed = 1,
    within: LengthLike | None = None,
    bandwidth_limit: FrequencyLike | None = None,
    also: Iterable[SettingName] = (),
    set: Changes = None,
    progress: Progress = silent,
) -> CompareAnswer:
    """Buy a joint or change settings: which of seven options brings machines like this one to rest, and at what cost.

    Parameters
    ----------
    machines : int
        Number of machines drawn around the stage, 20 or more.
    bandwidth_limit : str or float, optional
        Highest bandwidth that the machine or its drive allows, "15 Hz" or a number [Hz].
    also : list of str, optional
        Also settings of drives against friction, "limit", "leak", "hysteresis", "standstill", "push", "dither"; active
        disturbance rejection, "adrc"; or "all".

    Returns
    -------
    CompareAnswer
        The results of the options, ``answer.results``.

    Raises
    ------
    InputError
        For a stage or an option that is not usable.

    Examples
    --------
    >>> import friso
    >>> friso.compare(friso.example("thesis_drive"), machines=200)  # doctest: +SKIP
    """
    chosen = inputs.read_stage(stage, set, leaves_out=(), uncertain_too=True)
    tolerance = inputs.in_position(chosen, within)
    hertz = Quantity("Hz", positive, "15 Hz")
    limit = None if bandwidth_limit is None else inputs.quantity_of(bandwidth_limit, "bandwidth_limit", hertz)
    from friso.studies.compare.study import compare as compared

    correlations = inputs.correlations_of(stage, chosen)
    begins = partial(inputs.mention_unstable_loop, chosen)
    return CompareAnswer(
        compared(chosen, machines, seed, tolerance, correlations, progress, tuple(also), begins, limit)
    )
