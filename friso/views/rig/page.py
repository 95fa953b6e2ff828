"""What an experiment of the rig shows: words, numbers, figures, a page; each experiment has a module of its own."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from friso.identify.logs.mapping import Mapping, mapping_text, sidecar
from friso.rig.log_files import write_csv
from friso.stage import Stage
from friso.studies.rig.outcome import Outcome, RigLog
from friso.views.drawing.figure import Figure
from friso.views.files import Content, pictures
from friso.views.pages import Report
from friso.views.rig.outcome_view import OUTCOME_VIEWS


def sentences(outcome: Outcome) -> list[str]:
    """The results, the answer first, for the engineer who has to decide with them; before it, what failed."""
    return [*_failures(outcome), *OUTCOME_VIEWS[outcome.experiment].sentences(outcome)]


def _failures(outcome: Outcome) -> list[str]:
    """The logs that stopped early, in a sentence for each reason: they end where the run stopped."""
    by_reason: dict[str, list[str]] = {}
    for log in outcome.logs:
        if log.failure:
            when, _, reason = log.failure.partition(": ")
            by_reason.setdefault(reason or when, []).append(f"{log.name} {when}" if reason else log.name)
    return [
        f"{len(names)} of {len(outcome.logs)} logs stopped early: {reason} ({', '.join(names)})."
        for reason, names in by_reason.items()
    ]


def figures(outcome: Outcome) -> list[Figure]:
    """The figures, in the arrangement of the thesis."""
    return OUTCOME_VIEWS[outcome.experiment].figures(outcome)


def rig_files(outcome: Outcome) -> dict[str, Content]:
    """The page, the logs with how they are to be read, the truth in a folder of its own, and every figure in all
    formats."""
    images = figures(outcome)
    logs = {name: content for log in outcome.logs for name, content in _log_files(log, outcome.stage).items()}
    return {
        "rig.html": page(outcome, images),
        **logs,
        "truth/stage.toml": _stage_text(outcome.stage, outcome.seed),
        **pictures(images),
    }


def _log_files(log: RigLog, stage: Stage) -> dict[str, Content]:
    """The log as the drive writes it, how to read it beside it, and the truth behind it in a folder of its own."""
    heading, name = f"friso rig, seed {log.seed}", f"{log.name}.csv"
    csv = partial(write_csv, interval=log.interval)
    files: dict[str, Content] = {name: partial(csv, signals=log.logged, heading=heading)}
    if log.kind is not None:
        files[sidecar(Path(name)).name] = mapping_text(Mapping(experiment=log.kind, setup=_setup(log.stage, stage)))
    files[f"truth/{name}"] = partial(csv, signals=log.true, heading=f"{heading}: the truth behind {name}")
    files[f"truth/{log.name}.toml"] = _stage_text(log.stage, log.seed)
    return files


def _setup(machine: Stage, stage: Stage) -> dict[str, str]:
    """What of joint and controller was set otherwise for a log than in the stage file, as texts with units."""
    was, now = stage.given(), machine.given()
    return {
        f"{table}.{key}": text
        for table in ("joint", "controller")
        for key, text in now.get(table, {}).items()
        if isinstance(text, str) and text != was.get(table, {}).get(key)
    }


def _stage_text(stage: Stage, seed: int) -> str:
    return f"# friso rig, seed {seed}\n{stage.to_toml()}"


def page(outcome: Outcome, figures: Sequence[Figure]) -> str:
    """The page with its figures."""
    return Report.of_stage(
        "rig.html",
        outcome.stage,
        figures,
        experiment=outcome.experiment,
        seed=outcome.seed,
        sentences=sentences(outcome),
        notes=outcome.notes,
        logs=outcome.logs,
    ).html()
