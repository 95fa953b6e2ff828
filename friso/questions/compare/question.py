"""Isolator or firmware: stage files on the same drawn machines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, LengthLike, Seed, StageLike, StageLikes
from friso.progress import Progress, silent
from friso.stage import Stage


class CompareAnswer(Answer):
    """Several stages on the same machines; `result` is a `Comparison`."""

    @property
    def varied(self) -> Sequence[str]:
        """Return the keys over which machines are drawn."""
        return [*self.result.machines.from_file]

    @property
    def interrupted(self) -> bool:
        """Tell whether some stages were not run."""
        return bool(self.result.not_run)

    @property
    def failure(self) -> str:
        """Say how many runs stopped early; empty if none did."""
        stopped = sum(result.failed for result in self.result.results)
        return f"{stopped} runs stopped early" if stopped else ""


@question
def compare(
    stage: StageLikes,
    *,
    names: Sequence[str] | None = None,
    machines: int = 400,
    seed: Seed = 1,
    within: LengthLike | None = None,
    set: Changes = None,
    progress: Progress = silent,
) -> CompareAnswer:
    """Buy a joint or change settings: which of several stage files brings machines like this one to rest, and how soon.

    With one file, it is compared without isolator, with a faster controller and with an isolator, as friso tune would
    write these.

    Parameters
    ----------
    stage : Stage, path, dict, or a list of these
        The stages, their files, or their tables; all are tried on the same machines, drawn around the first.
    names : list of str, optional
        What the stages are called, in their order; default: the names of their files.
    machines : int
        Number of machines, 20 or more.

    Returns
    -------
    CompareAnswer
        The results of the stages, ``answer.results``.

    Raises
    ------
    InputError
        For a stage or an option that is not usable.

    Examples
    --------
    >>> import friso
    >>> friso.compare(["stage.toml", "tuned/tuned-isolator.toml"], machines=200)  # doctest: +SKIP
    """
    sources: Sequence[StageLike] = stage if isinstance(stage, list | tuple) else [stage]  # type: ignore[list-item]
    if not sources:
        raise inputs.wrong("stage", "no stage", "a stage file, or several", '"rig.toml"')
    chosen = [inputs.read_stage(source, set, leaves_out=(), uncertain_too=True) for source in sources]
    correlations = [inputs.correlations_of(*pair) for pair in zip(sources, chosen, strict=True)]
    tolerance = max(inputs.in_position(one, within) for one in chosen)
    if len({one.axis_kind for one in chosen}) > 1:
        raise inputs.wrong("stage", "axes that turn and axes that do not", "axes of one kind", '"rig.toml"')
    from friso.remedies import comparison
    from friso.remedies.machines import FEWEST_MACHINES, MOST_MACHINES

    inputs.whole_number(machines, "machines", FEWEST_MACHINES, MOST_MACHINES, "2000")
    for one in chosen:
        comparison.check_motion(one)
    inputs.mention_unstable_loop(chosen[0])
    if len(chosen) == 1 and names is None:
        stages, notes = comparison.with_remedies(chosen[0], tolerance, seed, correlations[0], progress)
        correlations = [correlations[0].among(one.uncertain()) for one in stages.values()]
    else:
        called = _named(sources, names)
        stages, notes = _once(dict(zip(called, chosen, strict=True)))
        correlations = [correlations[called.index(name)] for name in stages]
    return CompareAnswer(comparison.compare(stages, machines, seed, tolerance, correlations, progress, notes))


def _named(sources: Sequence[StageLike], names: Sequence[str] | None) -> list[str]:
    """Return a name for each stage: the one given, or that of its file, longer where that is needed.

    Raises InputError for given names of which not every stage has one of its own.
    """
    if names is not None:
        if len(names) != len(sources) or len({*names}) != len(names):
            expected = f"{len(sources)} different names, one for each stage file, in their order"
            raise inputs.wrong("names", ", ".join(names), expected, '"as is"')
        return [*names]
    given = [*map(inputs.stem_of, sources)]
    files = [stem if isinstance(one, Stage | Mapping) else str(one) for stem, one in zip(given, sources, strict=True)]
    several = [name if given.count(name) == 1 else file for name, file in zip(given, files, strict=True)]
    return [name if several.count(name) == 1 else f"{name} {n}" for n, name in enumerate(several, 1)]


def _once(stages: Mapping[str, Stage]) -> tuple[dict[str, Stage], tuple[str, ...]]:
    """Return each stage once, and notes on the others: friso tune copies the best of its files to tuned.toml.

    Of two names the longer one is kept, which says more.
    """
    kept, notes = dict[str, Stage](), list[str]()
    for name, stage in stages.items():
        same = next((known for known, other in kept.items() if other.flat() == stage.flat()), None)
        if same is None:
            kept[name] = stage
            continue
        told = max(same, name, key=len)
        kept = {told if known == same else known: other for known, other in kept.items()}
        notes.append(f"{same} and {name} are the same stage, which is compared once")
    return kept, tuple(notes)
