"""Collect what `friso check` says about a stage, as far as it can be refuted."""

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from friso.engine.allowance import allowance
from friso.engine.kernel import kernels
from friso.hunting import Case, CheckPart, Kick, ParameterMargin, Swinging, check, needed_kernels
from friso.stage import Stage

ATTRACTED = ("hunts", "bistable")

RUNS_AWAY = "runs away"
"""Word for a stage whose loop is unstable, on which there is no verdict."""


@dataclass(frozen=True)
class Edge:
    """The edge of hunting as a factor of the stage's bandwidth.

    It says whether it is sure, and its relative error. If it is not sure, it lies between that factor, up to which
    hunting was found, and `quiet`, at which none was found. The other `windows` of hunting run between two factors at
    which none was found.
    """

    factor: float
    sure: bool
    reserve: float
    quiet: float
    windows: tuple[tuple[float, float], ...] = ()

    @property
    def beyond(self) -> float:
        """Return the factor above which, by the claim, nothing may attract."""
        return self.factor * (1 + self.reserve) if self.sure else self.quiet


@dataclass(frozen=True)
class Claim:
    """The verdict on one case of a stage.

    It says whether it is sure, the edge of hunting (None: none was stated), the displacements that start hunting (None:
    nothing was said), the survey of attractors (None: no survey), and the margin in static friction (None: none was
    stated). `doubts` says why verdict and edge are not sure, by "verdict" and "edge".
    """

    case: str
    stage: Stage
    verdict: str
    sure: bool
    edge: Edge | None
    kick: Kick | None
    surveyed: Any = None
    doubts: Mapping[str, str] = field(default_factory=dict)
    friction: ParameterMargin | None = None

    @property
    def attracted(self) -> bool:
        return self.verdict in ATTRACTED

    @property
    def motions(self) -> tuple[Swinging, ...]:
        """Return the motions that are said to attract."""
        return self.surveyed.motions if self.surveyed else ()

    @property
    def swing(self) -> float:
        """Return half of peak to peak [m] of the least attractor; infinite without one."""
        return least_swing(self.motions)

    def __str__(self) -> str:
        text = f"{self.case}: {self.verdict}{'' if self.sure else ' (not sure)'}"
        if self.edge:
            text += f", edge at {self.edge.factor:.6g} of the bandwidth{'' if self.edge.sure else ' (not sure)'}"
        return text


@dataclass(frozen=True)
class Checked:
    """The claims on a stage, the CPU time [s] of the check with kernels present, and its `work`.

    For work see `friso.engine.allowance`.
    """

    claims: tuple[Claim, ...]
    cpu: float
    work: float


def checked(stage: Stage) -> Checked:
    """Check a stage; equal cases count once."""
    kernels(needed_kernels(stage))
    start = time.process_time()
    with allowance() as spent:
        cases = check(stage)
    cpu = time.process_time() - start
    unique: dict[int, tuple[str, Case]] = {}
    for name, case in cases.items():
        unique.setdefault(id(case), (name, case))
    return Checked(tuple(_claim(name, case) for name, case in unique.values()), cpu, spent.used)


def least_swing(motions: Iterable[Swinging]) -> float:
    """Return half of peak to peak [m] of the least of some motions; infinite without any."""
    return min((motion.amplitude for motion in motions), default=np.inf)


def _claim(name: str, case: Case) -> Claim:
    said = case.judgement
    verdict = RUNS_AWAY if case.runs_away else case.verdict
    sure = case.runs_away or (said.hunting.certain and verdict != "failed")
    end = said.margin
    windows = tuple(
        (window.low.outside if window.low else 0.0, window.high.outside if window.high else np.inf)
        for window in said.windows
    )
    edge = end and Edge(end.factor, sure and end.certain, end.reserve, end.quiet, windows)
    doubts = _doubts(case, sure, edge)
    return Claim(
        name, case.stage, verdict, sure, edge, said.displacement, said.hunting.surveyed, doubts, case.static_friction
    )


def _doubts(case: Case, sure: bool, edge: Edge | None) -> dict[str, str]:
    said, doubts = case.judgement, {}
    if not sure:
        doubts["verdict"] = case.solver.status if case.verdict == "failed" else said.hunting.reason
    if CheckPart.BANDWIDTHS in said.given_up:
        doubts["edge"] = "given up for its work" + (" between two bandwidths" if edge else "")
    elif edge and not edge.sure:
        doubts["edge"] = "no orbit to its end, or simulations beyond it not decided" if sure else "the verdict is not"
    return doubts
