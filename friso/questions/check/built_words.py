"""Say what the machine as built does, and what of its drive makes it differ from the one in continuous time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from friso.equations.bandwidth import bandwidth, static_frictions
from friso.hunting import ParameterMargin
from friso.hunting.criteria import ATTRACTED
from friso.questions.check.margin_words import margin_sentence
from friso.shown.text import after_loop, listed, range_with_unit, unstable_where, with_unit
from friso.stage import Stage
from friso.virtual_rig.verdict import Built


def built_sentences(built: Built, where: str = "") -> list[str]:
    """Say what the machine as built does, how sure that is, and why it differs if it does; then what its loop does.

    `where` says of which of several machines that is told.
    """
    looped = f"With its samples and delays the loop is {unstable_where(built.unstable)}."
    return [f"As built{where}: {does_as_built(built)}{_unlike(built)}.", *[looped] * bool(built.unstable)]


def built_in_short(built: Built) -> str:
    """Write in the fewest words whether the loop is unstable as built, what the machine does, and how sure that is."""
    does = f"as built: {built.verdict}{'' if built.certain else ' (not certain)'}"
    return "; ".join(filter(None, [after_loop("", (), built.unstable), does]))


def does_as_built(built: Built) -> str:
    """Say what the machine as built does, and why that is not certain, if it is not."""
    return _does(built) if built.certain else f"{_does(built)} (not certain: {_doubt(built)})"


def _does(built: Built) -> str:
    """Say what the machine does."""
    if built.verdict == "hunts":
        return f"hunts, {_swings(built)}"
    if built.verdict == "bistable":
        places = built.moves.get("hunts", 0)
        share = f"at {places} of {sum(built.moves.values())} places in a count" if places else ""
        kick = f"after a displacement of {with_unit(built.smallest_kick, 'm')}" if built.smallest_kick else ""
        return f"settles after this move, but hunts {listed([*filter(None, [share, kick])], 'and')}, {_swings(built)}"
    if built.verdict == "toggles":
        often = f" every {range_with_unit(*built.period, 's')}" if built.period else ""
        return f"settles, but toggles by no more than a count of its encoder{often}"
    if built.verdict == "settles":
        lost = f", but runs away after a displacement of {with_unit(built.runs_away_after, 'm')}"
        return f"settles{lost if built.runs_away_after else ''}"
    if built.verdict == "failed":
        return "runs away from its reference" if built.moves.get("runs away") else "could not be run to its end"
    if not built.followed:
        return "was not run, as its motion takes too many samples"
    if built.moves.get("open", 0) < sum(built.moves.values()):
        return "was seen at rest, but not at enough places in a count"
    return f"still moves {with_unit(built.followed, 's')} after its motion"


def _swings(built: Built) -> str:
    """Write the ranges of amplitude and period of the runs that swing."""
    assert built.amplitude
    size = f"±{range_with_unit(*built.amplitude, 'm')}".replace("±< ", "less than ±")
    return f"{size} every {range_with_unit(*built.period, 's')}" if built.period else size


def _doubt(built: Built) -> str:
    """Say why the verdict is not certain."""
    if built.slips_after is not None:
        return f"its integral still winds, and may break it away after {with_unit(built.slips_after, 's', 2)}"
    still = built.moves.get("rests", 0) + built.moves.get("toggles", 0)
    if built.verdict == "hunts" and still:
        return f"at {still} of {sum(built.moves.values())} places in a count it does not"
    runs = {fate: built.moves.get(fate, 0) + built.kicks.get(fate, 0) for fate in ("open", "failed")}
    if runs["open"] or runs["failed"]:
        count = sum(built.moves.values()) + sum(built.kicks.values())
        return f"{sum(runs.values())} of {count} runs were not followed to their end"
    return "a value of the stage file is unknown"


def _unlike(built: Built) -> str:
    """Say what makes the machine differ from the one in continuous time; "" if it does not."""
    if not built.differs:
        return ""
    would = "would not" if built.verdict in ATTRACTED else "would hunt"
    if not built.because:
        return f"; in continuous time it {would}, and no single part of the drive makes the difference"
    return f"; without {listed(built.because, 'or')} it {would}"


def built_margin_sentences(stage: Stage, margins: Mapping[str, ParameterMargin]) -> list[str]:
    """Say over which bandwidths, and which static friction, the machine as built does the same."""
    flat, sentences = stage.flat(), []
    for name, margin in margins.items():
        pairs = [*static_frictions(flat)]
        static = flat[pairs[0]] if len(pairs) == 1 else None
        own, unit = (bandwidth(flat), "Hz") if name == "bandwidth" else (static, "N")
        said = margin_sentence(name, margin, own, unit, thin=True)
        sentences.append(f"As built: {said[:1].lower()}{said[1:]}")
    return sentences


def built_document(built: Built) -> dict[str, Any]:
    """Return the verdict on the machine as built, and the runs behind it."""
    names = {"amplitude": "amplitude_m", "period": "period_s", "smallest_kick": "smallest_kick_m"}
    names |= {"runs_away_after": "runs_away_after_m", "followed": "followed_s", "slips_after": "slips_after_s"}
    names |= {"rest_error": "rest_error_m", "settled_after": "settled_after_s"}
    names |= {"unstable": "loop_unstable_while_it"}
    return {names.get(name, name): value for name, value in asdict(built).items()}
