"""Is the loop stable and robust, stuck or sliding: limit cases, margins, Bode plots."""

from friso.interface.question import WHY, Question

QUESTION = Question(
    __name__,
    50,
    WHY,
    'bode examples/thesis_rig.toml --frequencies "0.1 Hz..1 kHz" --out bode',
    details=True,
    during="analysing all states",
)
