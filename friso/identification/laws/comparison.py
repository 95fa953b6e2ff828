"""Compare friction laws by cross-validation: each is fitted without a part of the record, and predicts that part.

A law with more parameters always fits better, but does not always predict better. A law is supported unless it clearly
predicts worse than the best: by more than chance (a t test of the differences by parts and a sign test, at a level that
counts all laws: Bonferroni), and by more than an error below which laws count as equal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest
from scipy.stats import t as student

from friso.errors import InputError
from friso.identification.kind import Prior
from friso.identification.laws.fit import DraggedRecord, LawFit, LawProblem, blocks, dragged_record
from friso.identification.laws.settings import settings
from friso.identification.logs.log import Log
from friso.identification.readings.at_bearing import believed_between
from friso.progress import Progress, silent
from friso.stage import Stage
from friso.stage.tables import FRICTION, MOTOR_FRICTION, FrictionSection, friction_law, moving_mass


@dataclass(frozen=True)
class LawPrediction:
    """A friction law fitted to all records, with its errors in predicting left-out parts.

    The errors, shape (parts,), are relative to the friction's standard deviation in each part.
    """

    fit: LawFit
    errors: np.ndarray

    @property
    def law(self) -> str:
        """Return the name of the law."""
        return self.fit.law

    @property
    def error(self) -> float:
        """Return the mean of the errors."""
        return float(self.errors.mean())


@dataclass(frozen=True)
class LawComparison:
    """The friction laws, ranked by their prediction of logs, the best first.

    `logs` are the names of the logs used, and `left_out` has the reason for each other log by its name. `parts` is the
    number of parts into which the logs were cut; each part is predicted by fits to the others. `unseen` is true if fits
    started from the stage as it was before any log.
    """

    predictions: tuple[LawPrediction, ...]
    logs: tuple[str, ...]
    left_out: Mapping[str, str]
    parts: int
    unseen: bool = True

    @property
    def explained(self) -> bool:
        """Tell whether the best law predicts the left-out parts of the record well enough."""
        return self.predictions[0].error < settings.error_of_a_prediction

    @property
    def supported(self) -> tuple[LawPrediction, ...]:
        """Return the laws that predict about as well as the best; empty if no law predicts."""
        best = self.predictions[0]
        if not self.explained:
            return ()
        level = settings.chance_of_a_worse_law / max(len(self.predictions) - 1, 1)
        others = (law for law in self.predictions[1:] if law.error < settings.error_of_a_prediction)
        return (best, *(law for law in others if not _worse(law.errors - best.errors, level)))


def _worse(differences: np.ndarray, level: float) -> bool:
    """Tell whether a law's errors exceed those of the best law by more than chance.

    `differences`, shape (parts,), are by part of the record. Two tests are made, at half the `level` each: of the mean
    difference, and of the signs of the differences. One of them suffices; the mean, or the median for the signs, must
    also exceed the setting below which laws count as equal. A law that could not be run for a part is worse.
    """
    if not np.isfinite(differences).all():
        return True
    count, level = len(differences), level / 2  # of two tests
    chance = student.ppf(1 - level, count - 1) * differences.std(ddof=1) / np.sqrt(count) if count > 1 else np.inf
    more_often = binomtest(int((differences > 0).sum()), count, alternative="greater").pvalue < level
    least = settings.difference_of_worse_laws
    return bool(differences.mean() > max(chance, least) or (more_often and np.median(differences) > least))


def comparable() -> list[str]:
    """List the friction laws with stiction to which measured friction can be converted."""
    return [
        name
        for name, law in FRICTION.classes.items()
        if issubclass(law, FrictionSection) and law.shaped is not FrictionSection.shaped
    ]


def compare_laws(logs: Sequence[Log], stage: Stage, prior: Prior, progress: Progress = silent) -> LawComparison:
    """Fit every law to the logs, and let each predict left-out parts.

    Fits start from the stage before any log (`prior`), or from the `stage` identified from all logs if no fit can start
    from its law. Raises InputError if no log shows friction, and for a stage whose law has no stiction or that has
    friction at the motor too.
    """
    records, left_out = _records(logs, prior)
    if not records:
        reasons = "; ".join(f"{name}: {why}" for name, why in left_out.items()) or "no log over time"
        raise InputError("--laws", reasons, "a log of position and force that shows friction", "presliding.csv")
    base = prior.stage.flat() if prior.stage else {}
    unseen = base.get("friction.model") in comparable()
    flat = base if unseen else stage.flat() | {key: estimate.value for key, estimate in prior.estimates.items()}
    if f"{MOTOR_FRICTION}.model" in flat:
        raise InputError("--laws", "a stage with friction at the motor too", "the friction of one bearing", "no --laws")
    model = flat["friction.model"]
    before = friction_law(model).shown(flat) if model in comparable() else None
    if before is None:
        actual = f'"{model}", from which no fit can begin'
        raise InputError("friction.model", actual, f"one of {', '.join(comparable())}", 'model = "lugre"')
    mass = float(moving_mass(flat))
    laws, parts = comparable(), blocks(records, settings.parts_left_out)
    predictions = []
    for number, law in enumerate(laws):
        progress(number, len(laws), law)
        predictions.append(_prediction(LawProblem(law, mass, before, records), parts))
    progress(len(laws), len(laws), "laws")
    ordered = tuple(sorted(predictions, key=lambda prediction: prediction.error))
    return LawComparison(ordered, tuple(record.name for record in records), left_out, len(parts), unseen)


def _records(logs: Sequence[Log], prior: Prior) -> tuple[list[DraggedRecord], dict[str, str]]:
    """Read the logs as records of a dragged body.

    Also returns, by name of the log, why others cannot be used.
    """
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
    """Fit a law to all records, and then without each part in turn, which it predicts.

    `parts` has, for each part, a mask of the samples of every record. The error of a part is infinite if the run fails.
    """
    starts = problem.everywhere()  # starts exclude the fit to all records, which has seen the left-out part
    whole = problem.fitted([np.ones(len(r.force), bool) for r in problem.records], starts)
    errors = []
    for out in parts:
        fit = problem.fitted([~mask for mask in out], starts)
        left = problem.errors(fit.numbers[None])
        friction = [record.force - fit.mass * record.acceleration for record in problem.records]
        rest, size = (np.concatenate([row[mask] for row, mask in zip(rows, out, strict=True)])
                      for rows in ([row[0] for row in left], friction))  # fmt: skip
        with np.errstate(invalid="ignore"):  # after a failed run the residual is infinite
            off = float(np.sqrt(np.mean((rest - rest.mean()) ** 2)) / size.std())
        errors.append(off if np.isfinite(off) else np.inf)
    return LawPrediction(whole, np.array(errors))
