"""What stops the hunting: the least change of controller or joint that settles machines like this one."""

from friso.interface.question import STOPS, Question

QUESTION = Question(
    __name__,
    65,
    STOPS,
    'tune examples/thesis_rig.toml --only controller --within "2 um" --out tuned',
    details=True,
    during="what attracts the stage",
    metavars={"only": "<controller|joint>", "keep": "<controller|joint>"},
    answers_interrupted=True,
)
