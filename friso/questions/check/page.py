"""Write the report of `friso check`: one page that opens offline and prints.

Every run of the command gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from friso.hunting.criteria import PEAK_RULE
from friso.questions.check.draws import draws_figure, draws_sentences
from friso.questions.check.figures import check_figures
from friso.questions.check.isolator_words import isolator_sentence
from friso.questions.check.laws import laws_sentences
from friso.questions.check.table import rows, rows_behind
from friso.questions.check.words import conclusion, details_of, verdict_sentence
from friso.shown.cases import shown_cases
from friso.shown.files import Content
from friso.shown.motion_words import motion_sentences
from friso.shown.pages import Report
from friso.shown.unknown import if_so
from friso.stage.rig import left_out
from friso.studies.draws import Draws

if TYPE_CHECKING:
    from friso.hunting import Case
    from friso.remedies.catalogue import Suggestion
    from friso.studies.laws.verdicts import VerdictsByLaw


BASIS = (
    "The verdict is by everything that attracts the stage. Peaks are counted beside it: maxima of the position "
    f"{PEAK_RULE} (Fix, Univ. of Twente, Sec. 3.2.2). Settling times count from the last corner of the reference; "
    "where it stands at several places, the longest"
)


def check_files(
    cases: Mapping[str, Case],
    draws: Draws | None = None,
    isolator: Suggestion | None = None,
    laws: VerdictsByLaw | None = None,
) -> dict[str, Content]:
    """Return the report of a check by its file name; it is the only file."""
    return {"report.html": check_html(cases, draws, isolator, laws)}


def check_html(
    cases: Mapping[str, Case],
    draws: Draws | None = None,
    isolator: Suggestion | None = None,
    laws: VerdictsByLaw | None = None,
) -> str:
    """Return the report for the cases "given" and, with a joint, "locked" and "free".

    Cases without time responses have no figures. `draws`, `isolator` and `laws` add what drawn stages do, what an
    isolator would do, and the verdict across friction laws.
    """
    in_order = shown_cases(cases)
    stage = in_order[0].case.stage if "given" not in cases else cases["given"].stage
    tolerances = sorted({f"{item.case.solver.rtol:g}" for item in in_order})
    return Report.of_stage(
        "check",
        stage,
        (*check_figures(cases), *([draws_figure(draws)] if draws else [])),
        verdicts=[(item.colour, f"{item.label}{if_so(stage)}: {verdict_sentence(item, cases)}") for item in in_order],
        sentences=[
            *filter(None, [conclusion(cases)]),
            *details_of(cases),
            *(f"{omitted}." for omitted in [left_out(stage)] if omitted),
            *motion_sentences(stage),
            *filter(None, [stage.controller.note(stage.flat()), stage.note]),
            *([isolator_sentence(isolator)] if isolator else []),
            *(draws_sentences(draws) if draws else []),
            *(laws_sentences(laws) if laws else []),
        ],
        columns=in_order,
        rows=[*rows(in_order), *rows_behind(in_order)],
        computed=f", relative tolerance {', '.join(tolerances)}. {BASIS}",
    ).html()
