"""How good the leaf springs of a joint are: stiffness, modes, stress."""

from friso.interface.question import STOPS, Question

QUESTION = Question(
    __name__,
    70,
    STOPS,
    'flexure rig.toml --stroke "1 mm" --out flexure',
    during="bending the leaves",
)
