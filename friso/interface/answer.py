"""Define `Answer`, which every function of friso with a command returns.

The terminal, pages and programs show one and the same answer.

The numbers of its JSON document become an xarray.Dataset. Units come from the suffixes of keys, and dimensions from
tables with equal keys.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import copy_context
from functools import wraps
from html import escape
from importlib import import_module
from importlib.util import find_spec
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Concatenate, ParamSpec, TypeVar

import numpy as np

from friso.axis import LINEAR, AxisKind, speaking_of, unit_of_key
from friso.errors import InputError, escaped
from friso.interface.question import described
from friso.stage.arguments import check_arguments

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from friso.shown.blocks import AnswerBlock, Files
    from friso.shown.drawing.figure import Figure
    from friso.shown.pages import Report
    from friso.stage import Stage


_LEAF = (bool, int, float, str, type(None))


def dataset_of(document: Mapping[str, Any]) -> xr.Dataset:
    """Convert a JSON document to a Dataset.

    The first entry that holds tables by name, such as "cases", becomes a dimension of its name. Each number in these
    tables becomes a variable along it. The document's own numbers become variables, and its texts attributes.
    """
    import xarray as xr

    name = next((key for key, value in document.items() if _records(value)), None)
    records = _records(document[name]) if name else {}
    flat = {label: dict(_leaves(record)) for label, record in records.items()}
    keys = list(dict.fromkeys(key for leaves in flat.values() for key in leaves))
    variables = {
        _name_and_units(key)[0]: (name, _column([leaves.get(key) for leaves in flat.values()]), _name_and_units(key)[1])
        for key in keys
    }
    single = {key: value for key, value in document.items() if isinstance(value, _LEAF) and value is not None}
    variables |= {
        _name_and_units(key)[0]: ((), value, _name_and_units(key)[1])
        for key, value in single.items()
        if not isinstance(value, str)
    }
    coords = {name: list(flat)} if name else {}
    return xr.Dataset(variables, coords, {key: value for key, value in single.items() if isinstance(value, str)})


def _records(value: Any) -> Mapping[str, Mapping[str, Any]]:
    """Return tables by name, or by number if they are a list; empty for anything else."""
    if isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
        return {_label(item, number): item for number, item in enumerate(value)}
    if isinstance(value, dict) and len(value) and all(isinstance(item, dict) for item in value.values()):
        return value
    return {}


def _label(record: Mapping[str, Any], number: int) -> str:
    """Return the label of a table in a list: its name, or else its number."""
    return str(next((record[key] for key in ("name", "key", "id", "letter", "label") if key in record), number))


def _leaves(record: Mapping[str, Any], before: str = "") -> Any:
    """Yield keys with numbers and texts of a table, `record`, and of the tables in it.

    Keys in a table within begin with the name of that table. `before` begins all keys.
    """
    for key, value in record.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{before}{key}_")
        elif isinstance(value, _LEAF):
            yield f"{before}{key}", value


def _name_and_units(key: str) -> tuple[str, dict[str, str]]:
    """Split a key into its name and its unit as an attribute."""
    name, unit = unit_of_key(key)
    return name, {"units": unit} if unit else {}


def _column(values: list[Any]) -> np.ndarray:
    """Return numbers with NaN where one is missing; texts and booleans stay as they are."""
    if all(value is None or (isinstance(value, int | float) and not isinstance(value, bool)) for value in values):
        return np.array([np.nan if value is None else value for value in values], dtype=float)
    return np.array(values, dtype=object)


Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


def question(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Turn the function of a question into a public function of friso (a decorator).

    The decorated function checks its arguments, and restores the kind of axis, by which units are named, when it ends.
    Shared parameters are added to the docstring. Errors name a parameter by its name in Python.
    """
    function.__doc__ = described(function)
    answer, names = check_arguments(function), signature(function).parameters

    @wraps(function)
    def asked(*arguments: Arguments.args, **options: Arguments.kwargs) -> Returned:
        try:
            return copy_context().run(answer, *arguments, **options)
        except InputError as error:
            key, origin, example = error.key or error.origin, error.origin * bool(error.key), error.example
            name = key.removeprefix("--").replace("-", "_")
            if not key.startswith("--") or name not in names:
                raise
            example = re.sub(f"^{re.escape(key)} ", f"{name}=", example)
            raise type(error)(name, error.actual, error.expected, example, origin, error.also) from None

    return asked


_SHOWN = {
    "sentences",
    "blocks",
    "tables",
    "details",
    "next_steps",
    "figures",
    "document",
    "document_of_details",
    "page",
    "files",
}
"""Names of the methods by which an answer is shown."""


def _in_its_units(method: Callable[Concatenate[Answer, Arguments], Returned]) -> Callable[..., Returned]:
    """Wrap a method of an answer so that it speaks in the units of the answer's axis, and makes blocks only once."""

    @wraps(method)
    def shown(answer: Answer, *arguments: Arguments.args, **options: Arguments.kwargs) -> Returned:
        with speaking_of(answer.axis_kind):
            if method.__name__ != "blocks":
                return method(answer, *arguments, **options)
            if "_blocks" not in vars(answer):
                vars(answer)["_blocks"] = method(answer, *arguments, **options)
            return vars(answer)["_blocks"]

    return shown


class Answer:
    """What friso answers to a question.

    An answer is a list of `blocks`; terminal, page, notebook and JSON document show all of them in their order. The
    function `blocks` in the folder of its question makes them, in the module `blocks` or `words`. Further functions
    there are optional: `basis` says how all was computed, `further_files` returns files beside the page, `page_values`
    what a template of the question's own names, and `next_steps` what to do next. Each takes the `subject`. `result` is
    what the analysis returned. Attributes and items that the answer lacks are taken from the result, so that
    ``cases["given"]`` is a case of `friso.check` and ``runs.outcome`` a variable of `friso.sweep`.

    Attributes
    ----------
    result
        What the analysis returned: a Dataset, cases by name, or a class of its own.
    failure : str
        What could not be completed; "" where all went well.
    data : xarray.Dataset
        The numbers with their units.
    """

    result: Any
    axis_kind: AxisKind = LINEAR

    status: ClassVar[int] = 1
    """Exit status of the command if the answer is a failure."""

    def __init__(self, result: Any, **parts: Any) -> None:
        """Store the result, and other `parts` as attributes.

        The kind of axis is taken from the stage, unless it is one of the parts.
        """
        stage = parts.get("stage") or getattr(result, "stage", None)
        self.result, self.axis_kind = result, LINEAR if stage is None else stage.axis_kind
        vars(self).update(parts)

    def __init_subclass__(cls) -> None:
        """Make all methods that show an answer use the units of its axis."""
        cls.package = cls.__module__.rpartition(".")[0]
        for name in _SHOWN & vars(cls).keys():
            setattr(cls, name, _in_its_units(vars(cls)[name]))

    templates: ClassVar[str] = "friso.shown"
    """Package whose folder `templates` may have a template for the page of the question."""

    package: ClassVar[str]
    """Package of the question, whose modules show its answers."""

    @property
    def command(self) -> str:
        """Return the command that gives this answer."""
        return self._name.replace("_", "-")

    @property
    def _name(self) -> str:
        """Return the name of the question in Python, with which its functions begin."""
        return self.package.rpartition(".")[2]

    @property
    def subject(self) -> Any:
        """Return what the functions that show the answer take as their argument.

        The subject is the result, or the answer itself if it has attributes besides.
        """
        return self.result

    @property
    def condition(self) -> str:
        """Say on which values the answer rests that nobody knows; "" if on none.

        An answer that does not rest on the values of its stage overrides this.
        """
        from friso.shown.text import unknown_condition

        return unknown_condition(self._stage, self.varied)

    @property
    def _stage(self) -> Stage | None:
        """Return the stage that the answer is about, if there is one."""
        return vars(self).get("stage") or getattr(self.result, "stage", None)

    @property
    def varied(self) -> Sequence[str]:
        """Return the keys that the answer varies, so that it does not rest on their values."""
        return ()

    @property
    def failure(self) -> str:
        """Say what could not be completed or is not met; empty if all went well."""
        return ""

    @property
    def interrupted(self) -> bool:
        """Tell whether Ctrl-C ended the work, so that the answer says what was found so far."""
        return False

    def _shown_by(self, function: str, otherwise: Any, *more: Any) -> Any:
        """Show the answer by a `function` in the module `blocks`, `words` or `question` of the question's folder.

        Returns what that function returns for the answer's subject and `more` arguments, or `otherwise` if there is no
        such function.
        """
        for part in ("blocks", "words", "question"):
            place = f"{self.package}.{part}"
            if self.package and find_spec(place) and hasattr(module := import_module(place), function):
                return getattr(module, function)(self.subject, *more)
        return otherwise

    def blocks(self) -> Sequence[AnswerBlock]:
        """Return the parts of the answer, the conclusion first."""
        return [*self._shown_by("blocks", ())]

    def sentences(self) -> Sequence[str]:
        """Return the answer in words, the conclusion first, after the condition under which it holds."""
        sentences = [sentence for block in self.blocks() for sentence in block.sentences]
        return [self.condition + sentences[0], *sentences[1:]] if sentences else []

    def tables(self) -> Sequence[AnswerBlock]:
        """Return the blocks that have small tables, with the numbers behind the answer as texts."""
        return [block for block in self.blocks() if block.rows]

    def details(self) -> Sequence[str]:
        """Return further paragraphs, which `--details` shows; some may take work."""
        return [text for block in self.blocks() for text in (*block.details, *block.long_details())]

    def next_steps(self, files: Sequence[Path]) -> Sequence[str]:
        """Return commands that follow from the answer, given the `files` written."""
        return self._shown_by("next_steps", (), files)

    def figures(self) -> Sequence[Figure]:
        """Return the figures, the most important one first."""
        return [figure for block in self.blocks() for figure in block.figures]

    def document(self) -> dict[str, Any]:
        """Return the JSON document of the command: the numbers of all blocks, and the condition if there is one."""
        from friso.shown.documents import merged

        document, condition = merged(block.numbers() for block in self.blocks()), self.condition
        if not condition:
            return document
        said = document.get("conclusion", "")
        conclusion = {"conclusion": said if said.startswith(condition) else condition + said} if said else {}
        return {**document, **conclusion, "condition": condition.removesuffix(": ")}

    def page(self) -> Report:
        """Return the page that shows the answer."""
        from friso.shown.pages import Report

        return Report.of_stage(
            self.command,
            self._stage,
            self.blocks(),
            condition=self.condition,
            computed=self._shown_by("basis", ""),
            values=self._shown_by("page_values", {}),
            templates=self.templates,
        )

    def files(self) -> Files:
        """Return the contents of the files that the command writes, by name."""
        return {**self._shown_by("further_files", {}), **self.page().files()}

    @property
    def data(self) -> xr.Dataset:
        """Return the numbers of the answer with their units, as an xarray.Dataset."""

        return dataset_of(self.to_dict())

    def document_of_details(self) -> dict[str, Any]:
        """Return what `--details` adds to the JSON document, by default nothing.

        An answer that adds something may compute further for it.
        """
        return {}

    def to_dict(self, details: bool = False) -> dict[str, Any]:
        """The document that `--json` prints, without the files that a command writes.

        Parameters
        ----------
        details : bool
            Whether to add what `--details` adds to it, which may take work.

        Returns
        -------
        dict
            Plain numbers, texts, lists and dictionaries; SI units, named at the end of the keys (`_m`, `_s`, `_hz`).
        """
        return self.document() | (self.document_of_details() if details else {})

    def plot(self, axes: Axes | Sequence[Axes] | None = None, figure: int = 0) -> list[Axes]:
        """Draw one of the figures.

        Parameters
        ----------
        axes : matplotlib.axes.Axes or sequence of them, optional
            Where to draw its panels, one each; by default a figure is made.
        figure : int
            Which of the figures: 0 is the most telling one.

        Returns
        -------
        list of matplotlib.axes.Axes
            The axes of its panels.

        Raises
        ------
        InputError
            For a figure that there is not, and for other than one axes per panel.
        """
        from friso.shown.drawing.matplotlib_renderer import draw_on

        drawn = self.figures()
        if not 0 <= figure < len(drawn):
            expected = f"0 to {len(drawn) - 1}" if drawn else "no figure: this answer has none"
            raise InputError("figure", str(figure), expected, "plot(figure=0)" if drawn else "print(answer)")
        with speaking_of(self.axis_kind):
            return draw_on(drawn[figure], axes)

    def report(self, path: str | Path, overwrite: bool = False) -> list[Path]:
        """Write what the command writes with `--out`.

        Parameters
        ----------
        path : str or Path
            A folder; or a file that ends in .html, for the page alone.
        overwrite : bool
            Whether files of the same name may be replaced.

        Returns
        -------
        list of Path
            The files written.

        Raises
        ------
        InputError
            Where something is in the way, or there is no page.
        """
        from friso.interface.output_folder import OVERWRITE, OutputFolder, write_file

        place = Path(path)
        with speaking_of(self.axis_kind):
            page = self._page(place) if place.suffix == ".html" else None
            try:
                if page is None:
                    return OutputFolder(self.command, place, overwrite).write(self.files())
                write_file("path", place, page, overwrite)
            except InputError as error:
                expected = error.expected.replace(OVERWRITE, "overwrite=True")
                raise InputError("path", error.actual, expected, f'report("report-2{place.suffix}")') from None
        return [place]

    def _page(self, place: Path) -> str:
        """Return the HTML page of the answer.

        Raises InputError, which names the path `place`, for a command without a page.
        """
        page = next((content for name, content in self.files().items() if name.endswith("html")), None)
        if not isinstance(page, str):
            raise InputError("path", str(place), f"a folder: friso {self.command} has no page", 'report("folder")')
        return page

    def __repr__(self) -> str:
        return f"<friso {self.command}: {escaped(next(iter(self.sentences()), 'no answer'))}>"

    def __str__(self) -> str:
        return escaped("\n".join(self.sentences()))

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the sentences and the small tables, but no arrays."""
        first, *rest = [escape(sentence) for sentence in self.sentences()] or ["no answer"]
        tables = "".join(f"<pre>{escape(block.text)}</pre>" for block in self.blocks() if block.text)
        tables += "".join(_html_table(table) for table in self.tables() if not table.behind)
        texts = "".join(f"<p>{sentence}</p>" for sentence in rest)
        return escaped(f"<div><p><b>{first}</b></p>{texts}{tables}</div>")

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name == "result":
            raise AttributeError(name)
        try:
            return getattr(self.result, name)
        except AttributeError:
            raise AttributeError(f"{type(self).__name__} and what it holds have no {name!r}") from None

    def __getitem__(self, key: Any) -> Any:
        return self.result[key]

    def __iter__(self) -> Iterator[Any]:
        return iter(self.result)

    def __len__(self) -> int:
        return len(self.result)

    def __contains__(self, key: object) -> bool:
        return key in self.result

    def __bool__(self) -> bool:
        return True

    def __dir__(self) -> list[str]:
        own = (name for name in super().__dir__() if name.startswith("__") or not name.startswith("_"))
        plain = {*dir(Mapping), *dir(dict), *dir(tuple)}  # what any collection has says nothing of the answer
        return sorted({*own, *(name for name in dir(self.result) if not name.startswith("_") and name not in plain)})


for _name in _SHOWN:
    setattr(Answer, _name, _in_its_units(getattr(Answer, _name)))


def _html_table(table: AnswerBlock) -> str:
    """Write a small table as HTML, with all texts escaped."""
    head = "".join(f"<th>{escape(column)}</th>" for column in ("", *table.labels))
    rows = "".join(
        f"<tr><th>{escape(label)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
        for label, cells in table.rows
    )
    caption = f"<caption>{escape(table.title)}</caption>" if table.title else ""
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
