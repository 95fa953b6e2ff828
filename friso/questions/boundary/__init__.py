"""Where hunting ends: over one key, or in the plane of two."""

from friso.interface.question import WHERE, Question

QUESTION = Question(
    __name__,
    60,
    WHERE,
    'boundary rig.toml --set joint.locked=true --x controller.crossover="1 Hz..40 Hz" --out edge',
    details=True,
    during="following cycles",
)
