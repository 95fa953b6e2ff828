"""Whether a stage moved at constant speed slides smoothly, or sticks and slips"""

import numpy as np

from friso.equations.motions.ramp import VELOCITY
from friso.hunting import lasting_swings
from friso.studies.metric import MapFinding, Metric, RunEvidence, Word


def sliding(run: RunEvidence) -> np.ndarray:
    """Say of each cell whether its stage sticks and slips at the speed of its reference; (cells,).

    A cell whose reference does not move at constant speed is "no ramp".
    """
    flat, count = run.flat, len(run.measures.peaks)
    if flat["motion.kind"] != "ramp" or flat.get("friction.model", "none") == "none":
        return np.full(count, "no ramp", dtype=object)
    speed = np.broadcast_to(np.asarray(flat[VELOCITY], float), (count,))
    lasts, decided, _ = lasting_swings({**flat, VELOCITY: speed}, count)
    return np.where(decided, np.where(lasts, "sticks", "slides"), "undecided").astype(object)


METRIC = Metric(
    "Motion at constant speed",
    sliding,
    words=(
        Word(
            "sticks",
            "vermillion",
            "the error about the moving reference keeps swinging, from rest",
            label="sticks and slips",
        ),
        Word("undecided", "mauve", "whether the swing lasts was not decided in long runs", is_open=True),
        Word("slides", "quiet", "the swing about the moving reference dies out", label="slides smoothly"),
        Word("no ramp", "pink", "the reference does not move at constant speed against friction", is_open=True),
    ),
    place=73,
    criterion="whether the swing of the error lasts from a long run to a longer one, from rest",
    findings=(MapFinding("The stage sticks and slips", ("sticks",)),),
    doubt=("undecided", "In {share} of the map it was not decided whether the swing lasts."),
)
