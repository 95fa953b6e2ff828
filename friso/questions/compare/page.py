"""Write the page of `friso compare`: one file that opens offline and prints.

Every run of the command gives the same bytes.
"""

from __future__ import annotations

from friso.axis import axis_shown
from friso.quantities import percent
from friso.questions.compare import words
from friso.questions.compare.figures import compare_figures
from friso.shown.files import Content
from friso.shown.pages import Report
from friso.studies.compare.options import DEADBAND_SHARE, MODEL_ERROR
from friso.studies.compare.study import LONGER_FACTOR, Comparison


def compare_files(comparison: Comparison) -> dict[str, Content]:
    """Return the page, and every figure in all formats."""
    return Report.of_stage(
        "compare",
        comparison.stage,
        compare_figures(comparison),
        sentences=words.answer(comparison),
        details=words.details(comparison),
        population=words.population(comparison),
        remarks=comparison.notes,
        options=words.options_rows(comparison),
        columns=axis_shown().named(words.COLUMNS),
        rows=words.table_rows(comparison),
        paired_columns=axis_shown().named(words.PAIRED),
        paired=words.paired_rows(comparison),
        computed=(
            f" on a drive as built, seed {comparison.seed}; deadband {DEADBAND_SHARE:g} tolerances, model error "
            f"{percent(MODEL_ERROR)}"
        ),
        longer=LONGER_FACTOR,
        shaken=comparison.shaken,
    ).files()
