"""Whether the stage hunts, by a search of every cell"""

from friso.hunting.criteria import VERDICT_CRITERION
from friso.studies.metric import MapFinding, Metric, Word

METRIC = Metric(
    "Verdict on the stage",
    lambda stage: stage.verdicts(),
    source="survey",
    words=(
        Word("hunts", "vermillion", "a cycle of the stage attracts, and the motion of the stage file ends in it"),
        Word(
            "bistable",
            "pink",
            "a cycle attracts, but this motion comes to rest; a kick or another move can start hunting",
        ),
        Word("transient", "orange", "no cycle attracts, but this motion is not at rest by its end"),
        Word("undecided", "mauve", "whether a cycle attracts, or where this motion ends, is not certain", is_open=True),
        Word("settles", "quiet", "no cycle attracts, and this motion comes to rest"),
    ),
    place=71,
    criterion=VERDICT_CRITERION,
    verdict=True,
    doubt=("undecided", "In {count} of the cells the verdict is not certain."),
    findings=(
        MapFinding("The stage hunts", ("hunts",)),
        MapFinding("It is bistable (a kick or another move can start hunting)", ("bistable",), if_any=True),
    ),
)
