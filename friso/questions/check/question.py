"""Check whether the stage hunts: as given, and with its joint locked and free.

A stage file may state no friction; the answer then says for which friction the stage would hunt. Its blocks show the
cases, an isolator, the machines drawn, and other friction laws.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from friso.engine.batch import SIMULATION_RTOL, simulate
from friso.engine.kernel import kernels
from friso.errors import InputError
from friso.hunting import LONG_RUN_RTOL, Case, ParameterMargin, needed_kernels
from friso.hunting.criteria import PEAK_RULE, Verdict
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import LOGGER, Changes, LengthLike, Seed, StageLike, Tolerance, Whole
from friso.platform.interrupts import answers_interrupts
from friso.progress import Progress, silent
from friso.quantities import NOTHING
from friso.questions.check.built_words import built_document, built_margin_sentences, built_sentences
from friso.questions.check.cases import case_document, margin_document, peaks_shown, rows, rows_behind
from friso.questions.check.draws import (
    draws_colours,
    draws_details,
    draws_document,
    draws_figure,
    draws_rows,
    draws_sentences,
)
from friso.questions.check.laws import laws_columns, laws_document, laws_rows, laws_sentences
from friso.questions.check.margin_words import isolator_document, isolator_sentence, joint_sentences
from friso.questions.check.words import activity_sentences, answer, between_surveyed, details_of
from friso.shown.blocks import AnswerBlock, Files
from friso.shown.documents import plain_json
from friso.shown.motion_words import COLOURS, case_labels, motion_sentences, shown_cases
from friso.shown.text import if_so, range_with_unit, with_unit
from friso.stage import Stage
from friso.stage.correlations import Correlations, draw
from friso.stage.rig import is_as_built, left_out
from friso.stage.tables import passive_where
from friso.studies.draws import TRIAL_DRAWS, Draws, FrictionLevels

if TYPE_CHECKING:
    from pathlib import Path

    from friso.remedies.catalogue import Suggestion
    from friso.shown.drawing.figure import Figure
    from friso.studies.laws import VerdictsByLaw
    from friso.virtual_rig.verdict import Built


SHARES_OF_LEVELS = (0.05, 0.5)
"""Shares of machines that hunt from the levels of friction on that an answer states: some, and half."""


def levels_sentence(levels: FrictionLevels) -> str:
    """Say from which Coulomb friction on machines with similar contacts hunt, and what shows one's own."""
    some, half = map(levels.ends, SHARES_OF_LEVELS)
    if some is None:
        tried = range_with_unit(float(levels.coulomb[0]), float(levels.coulomb[-1]), "N")
        return f"The stage file has no [friction]: with usual bearings, {tried} of Coulomb friction, it would not hunt."
    also = f", and half from {with_unit(half[0], 'N')} on" if half else ""
    return (
        "The stage file has no [friction]: with usual bearings some such machines hunt from "
        f"{with_unit(some[0], 'N')} of Coulomb friction on{also}. A log of moves in both directions shows how much "
        "yours has (friso identify)."
    )


def levels_document(levels: FrictionLevels) -> dict[str, Any]:
    """Return the levels of Coulomb friction, and the share of machines that hunt at each."""
    return {"coulomb_n": levels.coulomb, "share_that_hunts": levels.shares, "machines": len(levels.hunts)}


MACHINES_DIFFER = "machines drawn from the uncertain keys differ"
"""Reason for an uncertain verdict at the centre of ranges over which the verdict changes."""


class CheckAnswer(Answer):
    """The verdict on a stage.

    `result` holds a `Case` for "given" and, with a joint, for "locked" and "free". `draws` are the results on machines
    drawn from uncertain keys, or None. `as_built` is the verdict on the stage with its drive, or None if the file
    describes none, and `built_margins` how far that holds, by parameter, if asked for. `cut` is true if Ctrl-C left
    some machines undrawn. `laws` holds the verdicts under all friction laws, or None.
    """

    stage: Stage
    draws: Draws | None
    laws: VerdictsByLaw | None
    cut: bool
    stage_file: str = ""
    as_built: Built | None = None
    built_margins: Mapping[str, ParameterMargin] = MappingProxyType({})

    def next_steps(self, files: Sequence[Path]) -> Sequence[str]:
        """Return the command that says what stops the hunting, for a file of a stage that hunts."""
        from friso.hunting.criteria import ATTRACTED

        return [f"friso tune {self.stage_file}"] if self.stage_file and self.verdict in ATTRACTED else []

    @property
    def varied(self) -> Sequence[str]:
        """Return the keys over which machines were drawn."""
        return [*self.draws.sample.keys] if self.draws else ()

    @property
    def interrupted(self) -> bool:
        """Tell whether Ctrl-C ended the work before all machines were drawn."""
        return self.cut

    @cached_property
    def friction_levels(self) -> FrictionLevels | None:
        """Return for which friction a stage would hunt whose stage file states none; None for any other."""
        if self.stage.states_friction:
            return None
        from friso.studies.draws import friction_levels

        return friction_levels(self.stage)

    @cached_property
    def isolator(self) -> Suggestion | None:
        """Return what an isolator would do for a hunting stage without a joint; None for any other."""
        from friso.hunting.criteria import ATTRACTED

        case = self.result["given"]
        if case.stage.joint or case.verdict not in ATTRACTED:
            return None
        from friso.remedies.catalogue import suggestion

        return suggestion(case.stage)

    @property
    def verdict(self) -> str:
        """Return the verdict on the stage as given, as built if it has a drive.

        It is "hunts", "bistable", "transient", "settles", "failed", or "none" while the reference keeps moving. A stage
        as built may also be "undecided", or it "toggles": it swings by at most a count of its encoder.
        """
        return self.as_built.verdict if self.as_built else self.result["given"].verdict

    @property
    def failure(self) -> str:
        """Say whether a run failed or ran away, and in which case; empty if all went well."""
        if any(not case.solver.done and not case.runs_away for case in self.result.values()):
            return "the computation could not be completed; see the status above"
        away = any(case.runs_away for case in self.result.values())
        return "there is no verdict on hunting for a motion that runs away" if away else ""

    @property
    def subject(self) -> CheckAnswer:
        """Return the answer itself, which has more than the cases."""
        return self

    def document_of_details(self) -> dict[str, Any]:
        """Return the margins in the joint's stroke and stiffness as a document."""
        from friso.questions.check.cases import joint_margins_document

        case = self.result.get("free", self.result["given"])
        return joint_margins_document(case.stage, self.joint_margins)

    @cached_property
    def joint_margins(self) -> Mapping[str, ParameterMargin]:
        """Return the margins in the joint's stroke and stiffness by key, with the joint free."""
        from friso.hunting import joint_margins

        case = self.result.get("free", self.result["given"])
        return joint_margins(case.stage, case.judgement)

    @cached_property
    def traced(self) -> Mapping[str, Case]:
        """Return the cases with their time responses, which the figures show."""
        return {name: replace(case, trace=simulate(case.stage, case.solver.rtol)) for name, case in self.result.items()}

    def files(self) -> Files:
        """Return the report, which is the only file."""
        return {"report.html": self.page().html()}


@question
def check(
    stage: StageLike,
    rtol: Tolerance = SIMULATION_RTOL,
    *,
    set: Changes = None,
    draws: Whole | None = None,
    seed: Seed = 0,
    laws: bool = False,
    as_built: bool = False,
    within: LengthLike | None = None,
    progress: Progress = silent,
) -> CheckAnswer:
    """Does the stage hunt: as given, and with its joint locked and free.

    Parameters
    ----------
    draws : int, optional
        Draw so many stages from the uncertain keys ("20 N +/- 1 N", "1 N .. 3 N"), and report how many hunt; default:
        as many as a fixed work allows, some tens, and none if the loop is unstable.
    laws : bool
        Give also the verdict under other friction laws, which keep what was measured as far as they can.
    as_built : bool
        Find also by how much bandwidth and static friction may change before the machine as built does something else.

    Returns
    -------
    CheckAnswer
        The cases by name: ``answer["locked"].verdict``, ``answer["locked"].judgement.cycle.amplitude`` [m].

    Raises
    ------
    InputError
        For a stage or an option that is not usable.

    Examples
    --------
    >>> import friso
    >>> answer = friso.check(friso.example("lugre_stick_slip"))
    >>> answer.verdict
    'transient'
    >>> print(answer.data["peak_to_peak"].attrs["units"])
    m
    """
    chosen = inputs.read_stage(stage, set, leaves_out=(), uncertain_too=True)
    tolerance = inputs.tolerance_of(rtol)
    correlations, file = inputs.correlations_of(stage, chosen), inputs.file_of(stage, set)
    chosen = inputs.with_tolerance(chosen, within)
    return checked_stage(chosen, correlations, tolerance, draws, seed, laws, progress, file, as_built)


MOST_DRAWS = 100_000
"""Most draws. At the edge of hunting a draw takes 50 ms, so more take hours."""


def checked_stage(
    chosen: Stage,
    correlations: Correlations,
    tolerance: float = SIMULATION_RTOL,
    draws: int | None = None,
    seed: int = 0,
    laws: bool = False,
    progress: Progress = silent,
    stage_file: str = "",
    as_built: bool = False,
) -> CheckAnswer:
    """Check a stage, and draw machines if its keys are uncertain, with these correlations.

    `draws` is the number of machines; by default, as many as a fixed work allows, and none if the loop is unstable.
    With `laws`, the stage is checked under other friction laws, too; with `as_built`, edges of hunting are found by
    runs of the machine with its drive. `tolerance` is that of the solver.
    `stage_file` is its path as a word of a command line. Raises InputError for a number of draws that is not usable.
    """
    loose = max(tolerance, LONG_RUN_RTOL)
    sample = uncertain = None
    if draws is not None:
        inputs.whole_number(draws, "draws", 1, MOST_DRAWS, "1000")
        try:
            sample = draw(chosen, correlations, draws, seed)
        except InputError as error:
            raise error if error.origin else error.found_in("--draws") from None
    elif chosen.uncertain():
        uncertain = _drawable(chosen, correlations, seed)
    from friso.hunting import check as judged

    kernels(needed_kernels(chosen))
    inputs.mention_unstable_loop(chosen)
    cases = judged(chosen, tolerance, progress=progress, tell=partial(mention_verdict, chosen))
    built, margins = None, dict[str, ParameterMargin]()
    if is_as_built(chosen):
        from friso.virtual_rig.verdict import judge_as_built

        built = judge_as_built(cases["given"])
    if built and as_built:
        from friso.virtual_rig.cures import edges

        margins = edges(cases["given"])
    drawn = across = None
    cut = False
    if uncertain is not None and cases["given"].unstable:
        inputs.note("no machines were drawn from the uncertain keys: at their centres the loop is unstable")
    elif uncertain is not None:
        from friso.studies.draws import affordable

        sample = draw(chosen, uncertain, affordable(chosen, uncertain, seed, loose), seed)
    if sample is not None:
        from friso.studies.draws import Draws

        answers_interrupts()  # from here on, an interruption still leaves an answer
        try:
            drawn = Draws.of(chosen, sample, seed, loose, progress)
            cases = {name: _as_drawn(case, drawn, name) for name, case in cases.items()}
            cut = drawn.asked > drawn.sample.count
        except KeyboardInterrupt:
            cut = True
    if laws and not cut:
        from friso.studies.laws import verdicts_by_law

        across = verdicts_by_law(chosen, loose, progress=progress)
    parts = {"draws": drawn, "laws": across, "cut": cut, "as_built": built, "built_margins": margins}
    return CheckAnswer(cases, stage=chosen, stage_file=stage_file, **parts)


def _as_drawn(case: Case, draws: Draws, name: str) -> Case:
    """Return a case of the check whose verdict is not certain if the machines drawn differ in it."""
    if not draws.split(name):
        return case
    hunting = replace(case.judgement.hunting, certain=False, reason=MACHINES_DIFFER)
    return replace(case, judgement=replace(case.judgement, hunting=hunting))


def mention_verdict(stage: Stage, name: str, verdict: Verdict) -> None:
    """Log the verdict on a stage as soon as it is certain, while other parts are still computed.

    `name` is the case: "given", "locked" or "free". The message goes to the logger "friso", at the level INFO.
    """
    from friso.questions.check.words import IN_SHORT
    from friso.shown.motion_words import case_labels

    if name in (labels := case_labels(stage)):
        LOGGER.info(f"{labels[name]}{if_so(stage)}: {IN_SHORT[verdict]}", extra={"meanwhile": True})


def _drawable(stage: Stage, correlations: Correlations, seed: int) -> Correlations | None:
    """Return the correlations of an uncertain stage if machines can be drawn from it.

    Returns None, with a warning, if nearly all machines drawn are invalid.
    """

    try:
        draw(stage, correlations, TRIAL_DRAWS, seed)
    except InputError as error:
        inputs.note(f"no machines were drawn from the uncertain keys ({error.actual}); their centres are used")
        return None
    return correlations


def basis(check: CheckAnswer) -> str:
    """Say how accurately the cases were simulated, and by which criteria they are judged."""
    tolerances = sorted({f"{case.solver.rtol:g}" for case in check.result.values()})
    beside = f" Peaks are counted beside it: maxima of the position {PEAK_RULE} (Fix, Univ. of Twente, Sec. 3.2.2)."
    counted = any(peaks_shown(case) not in (NOTHING, "0") for case in check.result.values())
    return (
        f", relative tolerance {', '.join(tolerances)}. The verdict is by everything that attracts the stage."
        f"{beside * counted} Settling times count from the last corner of the reference; where it "
        "stands at several places, the longest"
    )


def blocks(check: CheckAnswer) -> Iterator[AnswerBlock]:
    """Yield the blocks: first the verdicts, over all machines drawn where there are any, else on the stage as it is."""
    stage, cases, draws = check.stage, shown_cases(check.result), check.draws
    omitted = "" if check.as_built else left_out(stage)
    at_centre = AnswerBlock(
        title=f"{stage.name or 'The stage'}, at the centre of its ranges" if draws else stage.name,
        columns=cases,
        rows=rows(cases),
        details=[*_over_ranges(check), *details_of(check.result), *([f"{omitted}."] if omitted else [])],
        draw=partial(_figures, check),
        numbers=partial(_cases_document, check),
    )
    notes = filter(None, [stage.controller.note(stage.flat()), stage.note])
    says, colours = [*_verdicts(check), *motion_sentences(stage), *notes], [item.colour for item in cases]
    if built := check.as_built:
        yield AnswerBlock(
            sentences=[
                *built_sentences(built, ", at the centre of its ranges" if draws else ""),
                *built_margin_sentences(stage, check.built_margins),
            ],
            colours=[COLOURS["given"]],
            numbers=lambda: _built_document(check, built),
        )
    if draws:
        yield AnswerBlock(sentences=says, colours=[] if check.cut else draws_colours(draws))
        yield at_centre
    else:
        if check.cut:
            yield AnswerBlock(sentences=["Interrupted: no stages were drawn yet."])
        yield replace(at_centre, sentences=says, colours=colours)
    if suggested := check.isolator:
        yield AnswerBlock(
            sentences=[isolator_sentence(suggested)],
            numbers=lambda: {"isolator": plain_json(isolator_document(suggested))},
        )
    if levels := check.friction_levels:
        yield AnswerBlock(
            sentences=[levels_sentence(levels)],
            numbers=lambda: plain_json({"friction_levels": levels_document(levels)}),
        )
    if draws:
        yield AnswerBlock(
            title=f"{draws.sample.count} stages drawn from the uncertain keys, seed {draws.seed}",
            columns=[*case_labels(draws.stage).values()],
            rows=draws_rows(draws),
            draw=lambda: [draws_figure(draws)],
            numbers=lambda: plain_json(
                {"cases": {name: {"draws": draws_document(draws, name)} for name in check.result}}
            ),
        )
    if laws := check.laws:
        yield AnswerBlock(
            title="Across friction laws",
            sentences=laws_sentences(laws),
            columns=laws_columns(laws),
            rows=laws_rows(laws),
            numbers=lambda: plain_json({"laws": laws_document(laws)}),
        )
    yield AnswerBlock(
        title="How that was computed",
        columns=cases,
        rows=rows_behind(cases),
        behind=True,
        long_details=lambda: [
            *between_surveyed(check.result),
            *joint_sentences(check.joint_margins),
            *activity_sentences(passive_where(stage.flat())),
        ],
    )


def _verdicts(check: CheckAnswer) -> list[str]:
    """Say for each case whether the machines drawn hunt, or the stage itself where none were drawn."""
    return draws_sentences(check.draws) if check.draws else answer(check.result)


def _over_ranges(check: CheckAnswer) -> list[str]:
    """Say what the stage at the centre of its ranges does, and what would narrow them; nothing without draws."""
    if not check.draws:
        return []
    return [*(f"At the centre of the ranges: {text}" for text in answer(check.result)), *draws_details(check.draws)]


def _figures(check: CheckAnswer) -> Sequence[Figure]:
    """Draw motion and hunting cycles of all cases."""
    from friso.questions.check.figures import check_figures  # 0.7 s to import

    return check_figures(check.traced)


def _built_document(check: CheckAnswer, built: Built) -> dict[str, Any]:
    """Return the verdict as built beside that in continuous time."""
    given = check.result["given"]
    continuous = {"verdict": given.verdict, "certain": given.judgement.hunting.certain}
    margins = {name.replace(" ", "_"): margin_document(margin) for name, margin in check.built_margins.items()}
    return plain_json({"as_built": {**built_document(built), **margins}, "continuous": continuous})


def _cases_document(check: CheckAnswer) -> dict[str, Any]:
    """Return the conclusion, and all results as given, with the joint locked and free."""
    return plain_json(
        {
            "conclusion": " ".join(_verdicts(check)),
            "stage": check.stage.name,
            "friction_passive_where": passive_where(check.stage.flat()) or None,
            "cases": {name: case_document(case) for name, case in check.result.items()},
        }
    )
