"""`friso rig`: the virtual test rig: an experiment on the drive as built, its logs, the truth behind them, a figure."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.common import AsJson, Overrides, StageFile, check_place, made_folder, print_wrapped, say, with_overrides
from friso.cli.progress import step_bar
from friso.errors import InputError
from friso.stage import Stage, load

if TYPE_CHECKING:
    from friso.studies.rig.outcome import Outcome, RigLog

PAGE, TRUTH = "rig.html", "truth"

Experiment = Annotated[
    str,
    typer.Argument(
        metavar="EXPERIMENT",
        help="One of those below.",
    ),
]
OutFolder = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder for logs, true signals and figures.")
]
Seed = Annotated[
    int, typer.Option("--seed", metavar="NUMBER", help="Seed of the noise; the rail has its own, rail.seed.")
]

MOST_SEED = 10**15

MANY = 4
"""Samples from which a delay is worth a word."""


def rig(
    experiment: Experiment,
    stage_file: StageFile,
    overrides: Overrides = None,
    seed: Seed = 1,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Rehearse an experiment on the machine as built: sampled, quantised, saturated, on a rail that varies.

    Writes logs that friso identify reads, and apart from them the truth behind each.

    Example: friso rig stiffness examples/thesis_drive.toml --out rig
    """
    from friso.studies.rig.outcome import silent
    from friso.studies.rig.registry import RIG_EXPERIMENTS

    run = RIG_EXPERIMENTS[RIG_EXPERIMENTS.checked(experiment, "EXPERIMENT", "friso rig {} rig.toml")]
    stage = with_overrides(load(stage_file), overrides)
    _told(stage)
    if not 0 <= seed < MOST_SEED:
        raise InputError("--seed", str(seed), f"a whole number from 0, below {MOST_SEED:g}", "--seed 1")
    if out is not None:
        check_place(out, [f"{TRUTH}/stage.toml"], PAGE, [stage_file])
        if out.is_dir() and any(out.iterdir()) and not (out / TRUTH / "stage.toml").exists():
            given, expected = (
                f"{out}, with files that are not from an earlier friso rig",
                "an empty folder, or a new one",
            )
            raise InputError("--out", given, expected, f"--out {out}-2")
    with step_bar() as bar:
        outcome = run(stage, seed, bar or silent)
    files = [] if out is None else _written(outcome, made_folder(out))
    if as_json:
        from friso.views.rig.page import document

        print(json.dumps(document(outcome), allow_nan=False))
    else:
        _print(outcome, files)
    failed = [log for log in outcome.logs if log.failure]
    for log in failed:
        say(f"{log.name} stopped {log.failure}; the log so far is kept")
    if failed:
        raise typer.Exit(1)


def _told(stage: Stage) -> None:
    """What to know of the drive before it runs."""
    from friso.equations.as_built import whole_samples
    from friso.rig.run import SAMPLE_TIME, as_built_keys

    if stage.drive is None or stage.drive.sample_time is None:
        say(f"drive.sample_time is not given: {SAMPLE_TIME * 1e6:g} us, as in the thesis")
    samples = whole_samples(as_built_keys(stage))
    if samples >= MANY:
        say(f"drive.delay is {samples} samples: the force acts that much later than the reading it is computed from")
    if keys := [*stage.uncertain()]:
        say(f"uncertain keys ({', '.join(keys[:3])}{', ...' if len(keys) > 3 else ''}) are set to their centres")


def _print(outcome: Outcome, files: Sequence[Path]) -> None:
    from friso.views.rig.page import sentences

    for sentence in sentences(outcome):
        print_wrapped(sentence)
    print(f"seed of the noise: {outcome.seed}")
    for note in outcome.notes:
        print_wrapped(f"note: {note}")
    for file in files:
        print(f"wrote {file}")


def _written(outcome: Outcome, folder: Path) -> list[Path]:
    """Logs with how they are to be read, the truth in a folder of its own, figures and page."""
    from friso.views.drawing.matplotlib_renderer import FORMATS, save
    from friso.views.rig.page import figures, page

    truth = made_folder(folder / TRUTH)
    files = [_write_log(log, outcome.stage, folder, truth) for log in outcome.logs]
    _write_stage(outcome.stage, truth / "stage.toml", outcome.seed)
    drawn = figures(outcome)
    pictures = {folder / f"{figure.name}.{form}": figure for figure in drawn for form in FORMATS}
    for path, figure in pictures.items():
        save(figure, path)
    (folder / PAGE).write_text(page(outcome, drawn), encoding="utf-8", newline="\n")
    return [folder / PAGE, *files, truth / "stage.toml", *pictures]


def _write_log(log: RigLog, stage: Stage, folder: Path, truth: Path) -> Path:
    """The log as the drive writes it, how to read it beside it, and the truth in its own folder."""
    from friso.identify.logs.mapping import Mapping, save
    from friso.rig.log_files import write_csv

    path = folder / f"{log.name}.csv"
    said = f"friso rig, seed {log.seed}"
    write_csv(path, log.interval, log.logged, said)
    if log.kind is not None:
        save(Mapping(experiment=log.kind, setup=_setup(log.stage, stage)), path)
    write_csv(truth / path.name, log.interval, log.true, f"{said}: the truth behind {path.name}")
    _write_stage(log.stage, truth / f"{log.name}.toml", log.seed)
    return path


def _setup(own: Stage, stage: Stage) -> dict[str, str]:
    """What of joint and controller was set otherwise for a log than in the stage file, as texts with units."""
    was, now = stage.given(), own.given()
    return {
        f"{table}.{key}": text
        for table in ("joint", "controller")
        for key, text in now.get(table, {}).items()
        if isinstance(text, str) and text != was.get(table, {}).get(key)
    }


def _write_stage(stage: Stage, path: Path, seed: int) -> None:
    path.write_text(f"# friso rig, seed {seed}\n{stage.to_toml()}", encoding="utf-8", newline="\n")


def listed_experiments() -> list[tuple[str, str]]:
    """The experiments of the rig, each in one line."""
    from friso.studies.rig.registry import RIG_EXPERIMENTS

    return [(name, RIG_EXPERIMENTS.one_line(name)) for name in RIG_EXPERIMENTS]
