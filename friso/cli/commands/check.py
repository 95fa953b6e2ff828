"""`friso check`: the verdict."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.command import Command
from friso.cli.common import AsJson, Overrides, StageFile, Tolerance, leave, print_answer, read_stage, read_tolerance
from friso.cli.output import OutFolder, Overwrite, output_folder, print_document, print_written
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.stage import Stage, load

if TYPE_CHECKING:
    from friso.cure.suggestion import Suggestion
    from friso.hunting import Case
    from friso.stage.correlations import Sample
    from friso.studies.draws import Draws
    from friso.studies.laws.verdicts import VerdictsByLaw

Count = Annotated[
    int | None,
    typer.Option(
        "--draws",
        metavar="N",
        help='Draw N stages from the uncertain keys ("20 N +/- 1 N", "1 N .. 3 N"), and report how many hunt.',
    ),
]
Seed = Annotated[
    int, typer.Option("--seed", metavar="K", help="Seed of the draws: the same seed gives the same stages.")
]

AcrossLaws = Annotated[
    bool,
    typer.Option("--laws", help="The verdict under every friction law that shows the same in measurements, too."),
]


def check(
    stage_file: StageFile,
    overrides: Overrides = None,
    rtol: Tolerance = "1e-9",
    count: Count = None,
    seed: Seed = 0,
    laws: AcrossLaws = False,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Does the stage hunt: as given, and with its joint locked and free.

    Example: friso check examples/thesis_rig.toml --set controller.crossover="12 Hz" --out report
    """
    stage, tolerance = read_stage(stage_file, overrides, uncertain_too=count is not None), read_tolerance(rtol)
    sample = None if count is None else _sample(stage, stage_file, count, seed)
    target = output_folder("check", out, overwrite, [stage_file])
    from friso.hunting.check import LONG
    from friso.hunting.check import check as check_stage

    with ProgressBar("what attracts the stage") as progress:
        cases = check_stage(stage, rtol=tolerance, traces=target is not None, progress=progress)
    draws = None if sample is None else _draws(stage, sample, seed, max(tolerance, LONG))
    isolator = _isolator(cases["given"])
    across = _across_laws(stage, max(tolerance, LONG)) if laws else None
    files = []
    if target is not None:
        from friso.views.check.page import check_files

        files = target.write(check_files(cases, draws, isolator, across))
    if as_json:
        from friso.views.check.document import check_document

        print_document(check_document(cases, draws, isolator, across), files)
    else:
        _print_cases(stage, cases, isolator)
        if draws is not None:
            _print_draws(draws)
        if across is not None:
            _print_laws(across)
        print_written(files)
    leave(all(case.solver.done for case in cases.values()))


def _sample(stage: Stage, path: Path, count: int, seed: int) -> Sample:
    """Stages drawn, correlated as a file beside the stage file says. Raises InputError."""
    from friso.stage.correlations import Correlations, beside, draw, read_correlations
    from friso.studies.draws import MOST

    for option, value, least, most in (("--draws", count, 1, MOST), ("--seed", seed, 0, 2**32 - 1)):
        if not least <= value <= most:
            raise InputError(option, str(value), f"a whole number from {least} to {most}", f"{option} 1000")
    try:
        correlations = read_correlations(beside(path), load(path)) if beside(path).exists() else Correlations()
        return draw(stage, correlations.among(stage.uncertain()), count, seed)
    except InputError as error:
        raise error if error.origin else error.found_in("--draws") from None


def _draws(stage: Stage, sample: Sample, seed: int, tolerance: float) -> Draws:
    """What becomes of the stages drawn."""
    from friso.studies.draws import Draws, fates

    with ProgressBar("draws") as progress:
        return Draws(stage, sample, seed, fates(stage, sample, tolerance, progress))


def _across_laws(stage: Stage, tolerance: float) -> VerdictsByLaw:
    """What becomes of the stage under each law."""
    from friso.studies.laws.verdicts import verdicts_by_law

    with ProgressBar("laws") as progress:
        return verdicts_by_law(stage, tolerance, progress=progress)


def _print_laws(laws: VerdictsByLaw) -> None:
    """A sentence per case, and the table of the laws."""
    from friso.views.check.laws import laws_columns, laws_rows, laws_sentences

    print_answer(laws_sentences(laws), "Across friction laws", laws_columns(laws), laws_rows(laws))


def _print_draws(draws: Draws) -> None:
    """A sentence per case, and the table of the draws."""
    from friso.views.check.cases import case_labels
    from friso.views.check.draws import draws_rows, draws_sentences

    title = f"{draws.sample.count} stages drawn from the uncertain keys, seed {draws.seed}"
    print_answer(draws_sentences(draws), title, [*case_labels(draws.stage).values()], draws_rows(draws))


def _isolator(case: Case) -> Suggestion | None:
    """What an isolator would do for a stage without a joint that hunts."""
    if case.stage.joint or case.verdict not in ("hunts", "bistable"):
        return None
    from friso.cure.suggestion import suggestion

    with ProgressBar("what an isolator would do"):
        return suggestion(case.stage)


def _print_cases(stage: Stage, cases: dict[str, Case], isolator: Suggestion | None) -> None:
    """A sentence per case, what an isolator would do, and the short table of `check`."""
    from friso.views.check.cases import shown_cases
    from friso.views.check.isolator_words import isolator_sentence
    from friso.views.check.table import rows
    from friso.views.check.words import answer

    cases_in_order = shown_cases(cases)
    suggested = [isolator_sentence(isolator)] if isolator else []
    print_answer(
        [*answer(cases), *suggested], stage.name, [item.label for item in cases_in_order], rows(cases_in_order)
    )


COMMAND = Command(check, 20)
