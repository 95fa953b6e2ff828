"""What `friso check` says of a stage, as far as it can be refuted."""

from __future__ import annotations

import time
from dataclasses import dataclass

from friso.engine.kernel import kernel
from friso.equations.structure import structure
from friso.hunting import Case, check
from friso.hunting.attractors import Attractors
from friso.stage import Stage

ATTRACTED = ("hunts", "bistable")


@dataclass(frozen=True)
class Edge:
    """The edge of hunting as a factor of the stage's bandwidth, whether it is sure, and up to what share of it."""

    factor: float
    sure: bool
    reserve: float


@dataclass(frozen=True)
class Claim:
    """The verdict on one case of a stage, whether it is sure, the edge of hunting (None: none was named),
    displacements [m] that are said to start hunting, and what attracts, as it was surveyed (None: it was not)."""

    case: str
    stage: Stage
    verdict: str
    sure: bool
    edge: Edge | None
    kicks: tuple[float, ...]
    surveyed: Attractors | None = None

    @property
    def attracted(self) -> bool:
        return self.verdict in ATTRACTED

    def __str__(self) -> str:
        text = f"{self.case}: {self.verdict}{'' if self.sure else ' (not sure)'}"
        if self.edge:
            text += f", edge at {self.edge.factor:.6g} of the bandwidth{'' if self.edge.sure else ' (not sure)'}"
        return text


@dataclass(frozen=True)
class Checked:
    """The claims on a stage, and the CPU time [s] that the check took once its kernels were there."""

    claims: tuple[Claim, ...]
    cpu: float


def checked(stage: Stage) -> Checked:
    """What a check of the stage says; cases that are one and the same stage once."""
    for variant in stage.variants().values():
        for variational in (False, True):
            kernel(structure(variant.flat()), variational)
    start = time.process_time()
    cases = check(stage)
    cpu = time.process_time() - start
    unique: dict[int, tuple[str, Case]] = {}
    for name, case in cases.items():
        unique.setdefault(id(case), (name, case))
    return Checked(tuple(_claim(name, case) for name, case in unique.values()), cpu)


def _claim(name: str, case: Case) -> Claim:
    said = case.judgement
    sure = said.hunting.certain and case.verdict != "failed"
    edge = Edge(said.margin.factor, sure and said.margin.certain, said.margin.reserve) if said.margin else None
    windows = said.displacement.windows if said.displacement else ()
    kicks = tuple((low * high) ** 0.5 for low, high in windows)
    return Claim(name, case.stage, case.verdict, sure, edge, kicks, said.hunting.surveyed)
