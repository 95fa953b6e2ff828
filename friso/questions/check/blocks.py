"""Give the blocks of a check: the cases, an isolator, the machines drawn, and other friction laws."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from friso.hunting.criteria import PEAK_RULE
from friso.quantities import NOTHING
from friso.questions.check.cases import case_document, peaks_shown, rows, rows_behind
from friso.questions.check.draws import (
    draws_colours,
    draws_details,
    draws_document,
    draws_figure,
    draws_rows,
    draws_sentences,
)
from friso.questions.check.isolator_words import isolator_document, isolator_sentence
from friso.questions.check.laws import laws_columns, laws_document, laws_rows, laws_sentences
from friso.questions.check.levels import levels_document, levels_sentence
from friso.questions.check.margin_words import joint_sentences
from friso.questions.check.words import activity_sentences, answer, between_surveyed, details_of
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import plain_json
from friso.shown.motion_words import case_labels, motion_sentences, shown_cases
from friso.stage.rig import left_out
from friso.stage.tables import passive_where

if TYPE_CHECKING:
    from friso.questions.check.question import CheckAnswer
    from friso.shown.drawing.figure import Figure


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
    omitted = left_out(stage)
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
