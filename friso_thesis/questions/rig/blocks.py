"""Give the blocks of `friso rig`, and write the logs of an experiment."""

from __future__ import annotations

from collections import abc
from functools import partial
from pathlib import Path

import numpy as np

from friso.axis import LINEAR, unit_shown
from friso.identification.logs.roles import Mapping, mapping_text, sidecar
from friso.shown.blocks import AnswerBlock, Content
from friso.stage import Stage
from friso_thesis.questions.rig.words import rig_document, rig_figures, sentences
from friso_thesis.studies.rig.outcome import Outcome, RigLog


def blocks(outcome: Outcome) -> list[AnswerBlock]:
    """Return the blocks of the answer: the results, and the logs with the seeds of their noise."""
    return [
        AnswerBlock(
            title=outcome.stage.name,
            sentences=sentences(outcome),
            details=[f"seed of the noise: {outcome.seed}", *(f"note: {note}" for note in outcome.notes)],
            draw=partial(rig_figures, outcome),
            numbers=partial(rig_document, outcome),
        ),
        AnswerBlock(
            title="The logs",
            columns=("Kind", "Seed", "Sample time", "Ended"),
            rows=[
                (log.name, [log.kind or "", str(log.seed), f"{log.interval * 1e3:.3g} ms", log.failure or "as planned"])
                for log in outcome.logs
            ],
            behind=True,
        ),
    ]


def basis(outcome: Outcome) -> str:
    """Say on what the experiment ran, and how many logs it wrote."""
    counted = "1 log" if len(outcome.logs) == 1 else f"{len(outcome.logs)} logs"
    return f" on a drive as built, seed {outcome.seed}; {counted}"


def further_files(outcome: Outcome) -> dict[str, Content]:
    """Return the logs and how to read them; the truth behind them goes into a folder of its own."""
    logs = {name: content for log in outcome.logs for name, content in log_files(log, outcome.stage).items()}
    return {**logs, "truth/stage.toml": stage_text(outcome.stage, outcome.seed)}


UNITS = {"force": "N", "disturbance": "N", "velocity": "m/s", "cart_velocity": "m/s"}
"""Units of the signals that are not lengths."""


def log_files(log: RigLog, stage: Stage) -> dict[str, Content]:
    """Return a log as the drive writes it, and how to read it.

    The true signals and the stage of the log go into a folder of their own.
    """
    heading, name = f"friso rig, seed {log.seed}", f"{log.name}.csv"
    csv = partial(write_csv, interval=log.interval)
    files: dict[str, Content] = {name: partial(csv, signals=log.logged, heading=heading)}
    if log.kind is not None:
        axis = None if stage.axis_kind == LINEAR else stage.axis_kind.name
        mapping = Mapping(experiment=log.kind, axis=axis, setup=_setup(log.stage, stage))
        files[sidecar(Path(name)).name] = mapping_text(mapping)
    files[f"truth/{name}"] = partial(csv, signals=log.true, heading=f"{heading}: the truth behind {name}")
    files[f"truth/{log.name}.toml"] = stage_text(log.stage, log.seed)
    return files


def _setup(machine: Stage, stage: Stage) -> dict[str, str]:
    """Return the keys of joint and controller in which a log's `machine` differs from the stage.

    The values are texts with units, by key.
    """
    before, after = stage.as_written(), machine.as_written()
    return {
        f"{table}.{key}": text
        for table in ("joint", "controller")
        for key, text in after.get(table, {}).items()
        if isinstance(text, str) and text != before.get(table, {}).get(key)
    }


def stage_text(stage: Stage, seed: int) -> str:
    """Return the stage file behind a log, with the seed of its noise as comment."""
    return f"# friso rig, seed {seed}\n{stage.to_toml()}"


def write_csv(path: Path, interval: float, signals: abc.Mapping[str, np.ndarray], heading: str) -> None:
    """Write signals of shape (n,), by role, as CSV below a line of comment, the `heading`.

    Samples are `interval` [s] apart. Numbers have twelve digits, which is a nanometre in a kilometre. Raises OSError if
    the file cannot be written.
    """
    names = ["time [s]", *(f"{role} [{unit_shown(UNITS.get(role, 'm'))}]" for role in signals)]
    count = len(next(iter(signals.values())))
    columns = np.column_stack([np.arange(count) * interval, *signals.values()])
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"# {heading}\n{','.join(names)}\n")
        np.savetxt(file, columns, fmt="%.12g", delimiter=",")
