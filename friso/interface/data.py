"""Turn the numbers of a JSON document into an xarray.Dataset.

Units come from the suffixes of keys, and dimensions from tables with equal keys.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.axis import unit_of_key

if TYPE_CHECKING:
    import xarray as xr

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
