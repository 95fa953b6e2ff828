"""Write the page and the logs of an experiment of the rig."""

from __future__ import annotations

from friso.questions.rig.log_files import log_files, stage_text
from friso.questions.rig.words import rig_figures, sentences
from friso.shown.files import Content
from friso.shown.pages import Report
from friso.studies.rig.outcome import Outcome


def rig_files(outcome: Outcome) -> dict[str, Content]:
    """Return the page, the logs and how to read them, and every figure in all formats.

    The truth behind the logs goes into a folder of its own.
    """
    logs = {name: content for log in outcome.logs for name, content in log_files(log, outcome.stage).items()}
    return Report.of_stage(
        f"rig {outcome.experiment}",
        outcome.stage,
        rig_figures(outcome),
        sentences=sentences(outcome),
        notes=outcome.notes,
        columns=("Kind", "Seed", "Sample time", "Ended"),
        rows=[
            (log.name, [log.kind or "", str(log.seed), f"{log.interval * 1e3:.3g} ms", log.failure or "as planned"])
            for log in outcome.logs
        ],
        computed=f" on a drive as built, seed {outcome.seed}; {len(outcome.logs)} log{'s' * (len(outcome.logs) != 1)}",
    ).files({**logs, "truth/stage.toml": stage_text(outcome.stage, outcome.seed)})
