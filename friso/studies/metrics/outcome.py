"""What a run does at its end"""

from friso.hunting.criteria import CREEPS, LASTING_RATIO, OUTCOME_CRITERION, REST_BAND, RESTS, SWINGS
from friso.quantities import percent
from friso.studies.metric import MapFinding, Metric, Word

METRIC = Metric(
    "What the run does at its end",
    lambda run: run.measures.outcome,
    words=(
        Word(
            SWINGS,
            "vermillion",
            f"the run still swings at its end: periodically, more than {2e6 * REST_BAND:g} µm peak to peak in the last "
            f"quarter, by at least {percent(LASTING_RATIO)} of what it swings in the last half",
        ),
        Word(
            CREEPS,
            "orange",
            f"the run ends more than {1e6 * REST_BAND:g} µm off its reference without swinging: "
            "it drifts, sticks or decays",
        ),
        Word(RESTS, "quiet", f"the run comes to rest within {1e6 * REST_BAND:g} µm of its reference"),
    ),
    usual=True,
    place=70,
    criterion=OUTCOME_CRITERION,
    band=REST_BAND,
    findings=(MapFinding("The run swings at its end", (SWINGS,)),),
    doubt=(
        CREEPS,
        "It still creeps at its end in {share} of the map: a longer run shows whether it hunts there, and, if the "
        "reference comes to stand, so does the verdict of every cell (--metric sketch).",
    ),
)
