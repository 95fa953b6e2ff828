"""What a run does at its end"""

from friso.hunting.criteria import BAND, CREEPS, LASTING, OUTCOME_CRITERION, RESTS, SWINGS
from friso.quantities import percent
from friso.studies.metric import MapFinding, Metric, Word

METRIC = Metric(
    "What the run does at its end",
    lambda run: run.measures.outcome,
    words=(
        Word(
            SWINGS,
            "vermillion",
            f"the run still swings at its end: periodically, more than {2e6 * BAND:g} µm peak to peak in the last "
            f"quarter, by at least {percent(LASTING)} of what it swings in the last half",
            inferred="#f3c39e",
        ),
        Word(
            CREEPS,
            "orange",
            f"the run ends more than {1e6 * BAND:g} µm off its reference without swinging: it drifts, sticks or decays",
            inferred="#f7dfa8",
        ),
        Word(RESTS, "quiet", f"the run comes to rest within {1e6 * BAND:g} µm of its reference", inferred="#e4efe0"),
    ),
    usual=True,
    place=70,
    criterion=OUTCOME_CRITERION,
    band=BAND,
    findings=(MapFinding("The run swings at its end", (SWINGS,)),),
    doubt=(
        CREEPS,
        "It still creeps at its end in {share} of the map: a longer run, or the verdict of every cell (--metric "
        "sketch), shows whether it hunts there.",
    ),
)
