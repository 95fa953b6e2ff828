"""Which friction laws a record supports: each is fitted without a part of it, and predicts that.

A law with more numbers always fits better; what it predicts of what it was not fitted to need not be better (cross-
validation). The laws that predict as well as the best within one standard error of the difference are supported
(Breiman's rule: Hastie, Tibshirani, Friedman, The Elements of Statistical Learning, 2009, sec. 7.10).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from friso.errors import InputError
from friso.identification.kind import Prior
from friso.identification.laws.dragging import DraggedRecord, blocks, dragged_record
from friso.identification.laws.fit import LawFit, LawProblem, friction_of
from friso.identification.logs.log import Log
from friso.identification.readings.at_bearing import believed_between
from friso.progress import Progress, silent
from friso.stage import Stage
from friso.stage.tables import FRICTION, FrictionSection

PIECES = 5
"""Pieces in time by which a single record is cut."""

EXPLAINED = 0.3
"""Share of the friction's standard deviation up to which a prediction is one."""


@dataclass(frozen=True)
class LawPrediction:
    """A law as all records together show it, and by how much its predictions of each part that was left out are off, as
    a share of the friction's standard deviation there, shape (parts,)."""

    fit: LawFit
    errors: np.ndarray

    @property
    def law(self) -> str:
        """The name of the law."""
        return self.fit.law

    @property
    def error(self) -> float:
        """The mean of the errors."""
        return float(self.errors.mean())


@dataclass(frozen=True)
class LawComparison:
    """The laws, the best first; the names of the logs; those that were left out, with the reason; and how many parts
    were predicted."""

    predictions: tuple[LawPrediction, ...]
    logs: tuple[str, ...]
    left_out: Mapping[str, str]
    parts: int

    @property
    def explained(self) -> bool:
        """Whether any law predicts the record."""
        return self.predictions[0].error < EXPLAINED

    @property
    def supported(self) -> tuple[LawPrediction, ...]:
        """The laws that predict as well as the best within a standard error of the difference; none where no law
        predicts the record."""
        best = self.predictions[0]
        if not self.explained:
            return ()
        return tuple(law for law in self.predictions if law is best or not _worse(law.errors - best.errors))


def _worse(differences: np.ndarray) -> bool:
    """Whether errors are larger, by more than a standard error of the mean."""
    error = differences.std(ddof=1) / np.sqrt(len(differences))
    return bool(differences.mean() > error)


def comparable() -> list[str]:
    """The laws that stick and can be made from what is measured."""
    return [
        name
        for name, law in FRICTION.classes.items()
        if issubclass(law, FrictionSection) and law.shaped is not FrictionSection.shaped
    ]


def compare_laws(logs: Sequence[Log], stage: Stage, prior: Prior, progress: Progress = silent) -> LawComparison:
    """Fit every law to the same logs, and let each predict what it was not fitted to. Raises InputError where no log
    shows friction before sliding, and for a stage whose law does not stick."""
    records, left_out = _records(logs, prior)
    if not records:
        reasons = "; ".join(f"{name}: {why}" for name, why in left_out.items()) or "no log over time"
        raise InputError("--laws", reasons, "a log of position and force that shows friction", "presliding.csv")
    flat = {**stage.flat(), **{key: estimate.value for key, estimate in prior.estimates.items()}}
    before = friction_of(flat) if flat["friction.model"] in comparable() else None
    if before is None:
        actual = f'"{flat["friction.model"]}", from which no fit can begin'
        raise InputError("friction.model", actual, f"one of {', '.join(comparable())}", 'model = "lugre"')
    mass = flat.get("masses.cart", 0.0) + flat.get("masses.stage", 0.0)
    laws, parts = comparable(), blocks(records, PIECES)
    predictions = []
    for number, law in enumerate(laws):
        progress(number, len(laws), law)
        predictions.append(_prediction(LawProblem(law, mass, before, records), parts))
    progress(len(laws), len(laws), "laws")
    ordered = tuple(sorted(predictions, key=lambda prediction: prediction.error))
    return LawComparison(ordered, tuple(record.name for record in records), left_out, len(parts))


def _records(logs: Sequence[Log], prior: Prior) -> tuple[list[DraggedRecord], dict[str, str]]:
    """What can be read from the logs, and why from others nothing can."""
    records, left_out = [], {}
    for log in logs:
        if not {"position", "force"} <= {*log.signals}:
            left_out[log.name] = "it has not both position and force"
            continue
        record = dragged_record(log, believed_between(prior, log))
        if isinstance(record, str):
            left_out[log.name] = record
        else:
            records.append(record)
    return records, left_out


def _prediction(problem: LawProblem, parts: Sequence[Sequence[np.ndarray]]) -> LawPrediction:
    whole = problem.fitted([np.ones(len(r.force), bool) for r in problem.records], problem.everywhere())
    errors = []
    for out in parts:
        fit = problem.fitted([~mask for mask in out], whole.numbers[None])
        left = problem.errors(fit.numbers[None])
        friction = [record.force - fit.mass * record.acceleration for record in problem.records]
        rest, size = (np.concatenate([row[mask] for row, mask in zip(rows, out, strict=True)])
                      for rows in ([row[0] for row in left], friction))  # fmt: skip
        errors.append(float(np.sqrt(np.mean((rest - rest.mean()) ** 2)) / size.std()))
    return LawPrediction(whole, np.array(errors))
