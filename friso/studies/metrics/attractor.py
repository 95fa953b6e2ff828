"""What attracts the stage, by a survey from many starts

A cycle was closed as an orbit; a swing is one that simulations do not leave, of which no orbit could be closed. It is
unknown what attracts where simulations failed or had not settled when they were stopped, or where something may attract
beyond them.
"""

import numpy as np

from friso.studies.metric import MapFinding, Metric, StageEvidence, Word

CRITERION = (
    "what attracts the stage, by a survey of simulations from many starts: of several swings that attract the largest "
    "that was found"
)


def attractors(stage: StageEvidence) -> np.ndarray:
    """Say what attracts the stage of each cell: cycle, swing, nothing or unknown; (cells,)."""
    attracted = stage.attracted
    kind = np.where(attracted.attracts, np.where(attracted.closed, "cycle", "swing"), "nothing")
    return np.where(attracted.certain, kind, "unknown").astype(object)


def of_attractor(
    about: str, title: str, quantity: str, unit: str, place: int, limits: tuple[float, float] | None = None
) -> tuple[Metric, str]:
    """Return the entry of a metric that shows one quantity of the attractor, where it is certain what attracts.

    `about` says what it is.
    """
    metric = Metric(
        title,
        lambda stage: np.where(stage.attracted.certain, getattr(stage.attracted, quantity), np.nan),
        source="survey",
        unit=unit,
        usual=True,
        place=place,
        criterion=CRITERION,
        reasons="attractor",
        limits=limits,
        answered_by="attractor",
    )
    return metric, about


METRIC = Metric(
    "What attracts the stage",
    attractors,
    source="survey",
    words=(
        Word("cycle", "vermillion", label="a cycle attracts"),
        Word("swing", "pink", label="attracts, but not closed as an orbit"),
        Word("unknown", "mauve", label="not certain what attracts", is_open=True),
        Word("nothing", "quiet", label="nothing attracts"),
    ),
    usual=True,
    place=80,
    criterion=CRITERION,
    findings=(MapFinding("A lasting swing attracts the stage", ("cycle", "swing")),),
    doubt=("unknown", "In {count} of the cells it is not certain what attracts."),
    tallied=False,
)
