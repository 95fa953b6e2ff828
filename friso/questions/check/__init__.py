"""Does it hunt, with its margins in bandwidth and in friction."""

from friso.interface.question import HUNTS, Question

QUESTION = Question(
    __name__,
    20,
    HUNTS,
    'check examples/thesis_rig.toml --set controller.crossover="12 Hz" --out report',
    details=True,
    during="what attracts the stage",
)
