"""Follow hunting cycles through one key or two to where they lose stability."""

from friso.hunting.boundary.diagram import Diagram, diagram
from friso.hunting.boundary.plane import Curve, Plane, plane
from friso.hunting.boundary.space import KeyRange, Space
from friso.hunting.continuation.branch import END_OF_RANGE, Branch, Point
from friso.hunting.continuation.locate import Bifurcation, LocatedPoint

__all__ = [
    "END_OF_RANGE",
    "Bifurcation",
    "Branch",
    "Curve",
    "Diagram",
    "KeyRange",
    "LocatedPoint",
    "Plane",
    "Point",
    "Space",
    "diagram",
    "plane",
]
