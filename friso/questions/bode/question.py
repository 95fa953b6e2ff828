"""Analyse whether the loop is stable, stuck or sliding, and how fast it may be.

The answer holds limit cases, margins and Bode plots.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from friso.errors import InputError
from friso.interface.answer import Answer, question
from friso.interface.inputs import AS_BUILT, Changes, FrequencyBand, StageLike, read_stage, text_of, wrong
from friso.progress import Progress, silent
from friso.quantities import Bound, Quantity, quoted
from friso.stage import Stage

if TYPE_CHECKING:
    from friso.shown.drawing.figure import Figure

FREQUENCY = Quantity("Hz", Bound("from 1 uHz to 1 GHz", lambda value: (value >= 1e-6) & (value <= 1e9)), "0.1 Hz")
EXAMPLE = '"0.1 Hz..1 kHz"'


class BodeAnswer(Answer):
    """The linear analysis of a stage; `result` is a `Bode` with limit cases, margins and limits."""

    def first_figures(self) -> Sequence[Figure]:
        """Return the figures of the limit cases, which are ready before the others."""
        from friso.questions.bode.figures import first_figures

        return first_figures(self.result)


@question
def bode(
    stage: StageLike,
    frequencies: FrequencyBand | tuple[float, float] | None = None,
    series: bool = False,
    *,
    set: Changes = None,
    progress: Progress = silent,
) -> BodeAnswer:
    """Is the controller stable and robust, stuck or sliding, and how fast may it be: margins and Bode plots.

    Parameters
    ----------
    frequencies : str or tuple of two floats, optional
        Range of the figures, "0.1 Hz..1 kHz" or two numbers [Hz]; default: all that is relevant.
    series : bool
        Show also the thesis's formula for a touched limiter.

    Returns
    -------
    BodeAnswer
        The limit cases by name, ``answer.cases["stuck"].margins``, and the limits of the crossover.

    Raises
    ------
    InputError
        For a stage or frequencies that are not usable.

    Examples
    --------
    >>> import friso
    >>> answer = friso.bode(friso.example("thesis_rig"))
    >>> sorted(answer.cases)
    ['sliding', 'sliding-touched', 'stuck', 'stuck-touched']
    """
    chosen = read_stage(stage, set, leaves_out=AS_BUILT[1:])
    band = None if frequencies is None else _band(frequencies, chosen)
    from friso.frequency.bode import bode as analysed

    return BodeAnswer(analysed(chosen, band, series))


def _band(entry: str | tuple[float, float], stage: Stage) -> tuple[float, float]:
    """Return both ends [Hz] of a range of frequencies.

    Raises InputError for a text that is no increasing range, or a range beyond half the sampling frequency.
    """
    text = entry if isinstance(entry, str) else f"{text_of(entry[0], 'Hz')}..{text_of(entry[1], 'Hz')}"
    first, _, last = text.partition("..")
    if not (first.strip() and last.strip()):
        raise wrong("frequencies", quoted(text), "a range of frequencies, FIRST..LAST", EXAMPLE)
    try:
        low, high = float(FREQUENCY.read(first)), float(FREQUENCY.read(last))
    except InputError as error:
        raise wrong("frequencies", error.actual, error.expected, EXAMPLE) from None
    if not low < high:
        order = "empty" if low == high else "reversed"
        raise wrong("frequencies", quoted(text, f"{order} range"), "an increasing range", EXAMPLE)
    sample_time = stage.flat().get("drive.sample_time")
    if sample_time and high > 0.5 / sample_time:
        half = f"frequencies of up to {0.5 / sample_time:g} Hz, half the sampling frequency (drive.sample_time)"
        raise wrong("frequencies", quoted(text), half, f'"0.1 Hz..{0.5 / sample_time:g} Hz"')
    return low, high
