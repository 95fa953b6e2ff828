"""Hunting by its return map: from the distance at which a stage lands to that at which it lands next."""

from friso.hunting.return_map.attracting import MapSurvey, survey_maps
from friso.hunting.return_map.kicks import displacements_by_map, moves_by_map, own_motion_by_map, pushes_by_map
from friso.hunting.return_map.landing_map import LandingMap, MapAttractor
from friso.hunting.return_map.landings import Landings, find_landings
from friso.hunting.return_map.mapped import Mapped, map_stages
from friso.hunting.return_map.over_bandwidth import search_by_maps

__all__ = [
    "LandingMap",
    "Landings",
    "MapAttractor",
    "MapSurvey",
    "Mapped",
    "displacements_by_map",
    "find_landings",
    "map_stages",
    "moves_by_map",
    "own_motion_by_map",
    "pushes_by_map",
    "search_by_maps",
    "survey_maps",
]
