"""Judge which parameter decides most on hunting (Sec. 3.3), over Table 3's ranges."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

from friso.equations.controllers.pid import ALPHA, BETA, CROSSOVER
from friso.intervals import separation
from friso.stage import loads
from friso.studies.axes import Samples
from friso.studies.sweep import sweep
from friso_thesis.studies.thesis.claims import Evidence, Finding, FindingTable, Part, judges
from friso_thesis.studies.thesis.space import DRAW_SEED
from friso_thesis.studies.thesis.studies import STUDIES

_LOCKED, _FREE = ("system", "friction", "control"), ("isolator-stiffness", "isolator-masses", "isolator-friction")
_NAMES: Mapping[str, str] = MappingProxyType(
    {
        CROSSOVER: "crossover",
        "mass": "mass",
        "friction.static": "static friction",
        "friction.coulomb": "Coulomb friction",
        ALPHA: "alpha",
        BETA: "beta",
        "joint.stiffness": "joint stiffness",
        "joint.stroke": "stroke",
        "joint.limiter_damping": "limiter damping",
        "masses.cart": "mass of the cart",
        "masses.stage": "mass of the stage",
    }
)


@judges("S33", figure="Sec. 3.3, influence")
def ranks_of_influence(evidence: Evidence) -> Finding:
    """Judge which parameters of Table 3 separate stages that hunt from others best."""
    return judged_ranks(*influences(evidence.rig.to_toml()))


@lru_cache(maxsize=8)
def influences(stage_file: str) -> tuple[dict[str, float], dict[str, float]]:
    """Return how each parameter correlates with counted peaks, joint locked and joint free.

    The measure is the rank-biserial correlation.
    """
    locked = [STUDIES[name] for name in _LOCKED]
    free = [STUDIES[name] for name in _FREE] + [STUDIES["isolator-damping"], STUDIES["isolator-crossover"]]
    return _influence(stage_file, locked, True), _influence(stage_file, free, False)


INFLUENCE_DRAWS = 1024  # [stages]
"""Number of stages drawn for a rank correlation, whose two standard errors are then 0.06."""

INFLUENCE_RTOL = 1e-5
"""Relative tolerance of runs for the correlations, ten times tighter than the thesis's. Tighter runs count the same
peaks."""


def _influence(stage_file: str, studies: list, locked: bool) -> dict[str, float]:
    """Return the correlation of each parameter with counted peaks, joint locked or free.

    Stages are drawn evenly from the ranges of some studies.
    """
    spans = {span.key: span for study in studies for span in study.spans}
    links = {key: text for study in studies for key, text in study.links.items()}
    ranges = {key: span.text(2).rsplit(":", 2)[0] + (":log" if span.log else "") for key, span in spans.items()}
    stage = loads(stage_file).replace({"joint.locked": locked})
    samples = Samples(ranges, count=INFLUENCE_DRAWS, seed=DRAW_SEED)
    runs = sweep(stage, {}, samples, links, ["peaks", "outcome"], INFLUENCE_RTOL)
    valid = ~runs["outcome"].isin(["invalid", "failed"]).values
    hunts = runs["peaks"].values[valid] > 0
    if hunts.all() or not hunts.any():
        return dict.fromkeys((_NAMES[key] for key in spans), 0.0)
    return {_NAMES[key]: separation(runs[key].values[valid], hunts)[0] for key in spans}


def judged_ranks(locked: Mapping[str, float], free: Mapping[str, float]) -> Finding:
    """Judge whether the parameters that the thesis names separate hunting stages best.

    `locked` and `free` have the rank-biserial correlation by parameter, for the two states of the joint.
    """
    orders = {name: sorted(of, key=lambda key: -abs(of[key])) for name, of in (("locked", locked), ("free", free))}
    rows = tuple(
        (name, str(place), key, f"{of[key]:+.2f}")
        for name, of in (("locked", locked), ("free", free))
        for place, key in enumerate(orders[name], 1)
    )
    return Finding.of(
        Part(
            "with the joint locked the crossover separates the stages that hunt from the others best",
            orders["locked"][0] == "crossover",
            _listed(locked, orders["locked"]),
            why="Another parameter of Table 3 decides more, over its range.",
        ),
        Part(
            "with it free, of the parameters of the joint and the friction, stroke and stiffness do best, the "
            "crossover apart",
            {"stroke", "joint stiffness"} == set([key for key in orders["free"] if key != "crossover"][:2]),
            _listed(free, orders["free"]),
            why="Another parameter of Table 3 decides more, over its range.",
        ),
        table=FindingTable(("joint", "rank", "parameter", "rank-biserial correlation"), rows),
    )


def _listed(of: Mapping[str, float], order: list[str]) -> str:
    """Return the four most decisive parameters with their correlations, the most decisive first."""
    return ", ".join(f"{key} {of[key]:+.2f}" for key in order[:4])
