"""Say with which verdict a controller leaves friso, and what was written."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from friso.drives.target import TARGETS, Parcel
from friso.hunting.criteria import ATTRACTED, UNDECIDED
from friso.questions.check.words import IN_SHORT
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import plain_json
from friso.shown.text import unknown_condition, with_unit
from friso.version import VERSION

if TYPE_CHECKING:
    from friso.questions.check.question import CheckAnswer
    from friso.questions.export.question import ControllerAnswer


def verdict_words(check: CheckAnswer) -> tuple[str, bool]:
    """Say what the check found, and whether it is a sure verdict that the stage does not hunt."""
    case = check.result["given"]
    hunting, verdict = case.judgement.hunting, case.verdict
    if not check.stage.states_friction:
        return "there is no verdict: the stage file states no friction", False
    if check.failure or verdict == "failed":
        return f"there is no verdict: {check.failure or 'the run was not completed'}", False
    if verdict == "none":
        return "there is no verdict: the reference keeps moving", False
    if verdict in UNDECIDED or not hunting.certain:
        leaning = f"; it {IN_SHORT[verdict]}, as far as was seen" if verdict in IN_SHORT else ""
        return f"the verdict is uncertain ({hunting.reason or 'where its motion ends'}){leaning}", False
    return f"the stage {IN_SHORT[verdict]}", verdict not in ATTRACTED


def verdict_line(check: CheckAnswer) -> str:
    """Write the verdict as a line, as a warning unless it is surely that the stage does not hunt."""
    words, fine = verdict_words(check)
    condition = unknown_condition(check.stage, check.varied)
    return f"{'' if fine else 'WARNING: '}{condition}{words} (friso check)."


def header(parcel: Parcel, check: CheckAnswer) -> list[str]:
    """Write the lines that stand at the head of every file: what this is, and for what it holds."""
    stage, program = check.stage, parcel.program
    flat = stage.flat()
    motion = stage.as_written().get("motion", {})
    moves = ", ".join(f"{key} = {value}" for key, value in motion.items())
    late = flat.get("drive.delay", 0.0)
    waits = (
        [f"The drive adds its delay of {with_unit(late, 's')} after each sample; it is not part of the controller."]
        if late
        else []
    )
    uncertain = [*stage.uncertain()]
    centres = [f"At the centres of uncertain keys: {', '.join(uncertain)}."] if uncertain else []
    lines = [
        f"Controller of {' '.join(stage.name.split()) or 'a stage'}, sampled every {with_unit(program.period, 's')}.",
        f"Exported by friso {VERSION}; SHA-256 of the stage: {parcel.digest}.",
        f"Verdict: {verdict_line(check)}",
        f"Judged for the motion: {' '.join(moves.split())}.",
        "The verdict is on this controller in continuous time; samples and delays count where they make it unstable.",
        *centres,
        *waits,
    ]
    shown = ("".join(filter(str.isprintable, line)) for line in lines)
    return [line.replace("µ", "u") for line in shown]  # editors of PLCs differ in what they make of it


def controller_blocks(answer: ControllerAnswer) -> list[AnswerBlock]:
    """Return the blocks: the verdict, what was written, and the files."""
    parcel, files = answer.result, answer.target_files
    program, title = parcel.program, TARGETS[answer.to].title
    words, fine = verdict_words(answer.check)
    verdict = f"{words[0].upper()}{words[1:]} (friso check)." if fine else verdict_line(answer.check)
    what = (
        f"Its controller as {title}, sampled every {with_unit(program.period, 's')}: {program.operations} operations "
        f"and {len(program.memories)} numbers kept a sample, output in {parcel.unit}."
    )
    test = f"Its test compares {len(parcel.vector.output)} samples with friso's own run as built."
    contents = {name: content.encode() if isinstance(content, str) else content for name, content in files.items()}
    rows = [(name, [f"{len(content) / 1e3:.1f} kB"]) for name, content in contents.items()]
    remark = TARGETS[answer.to].remark()
    return [
        AnswerBlock(
            sentences=[verdict, what, test, *([remark] if remark else [])], numbers=partial(controller_document, answer)
        ),
        AnswerBlock(title="Files, with --out", columns=("Size",), rows=rows),
    ]


def controller_document(answer: ControllerAnswer) -> dict[str, Any]:
    """Return the verdict, the sizes, and the names of the files."""
    parcel = answer.result
    words, fine = verdict_words(answer.check)
    return plain_json(
        {
            "stage": answer.stage.name,
            "verdict": answer.check.verdict,
            "sure_not_to_hunt": fine,
            "conclusion": words,
            "sample_time_s": parcel.program.period,
            "output_unit": parcel.unit,
            "operations": parcel.program.operations,
            "memories": len(parcel.program.memories),
            "stage_sha256": parcel.digest,
            "files": [*answer.target_files],
        }
    )
