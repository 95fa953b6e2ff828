"""How far from its target friction may hold a stage."""

from friso.interface.question import WHY, Question

QUESTION = Question(__name__, 125, WHY, "resting rig.toml --out resting")
