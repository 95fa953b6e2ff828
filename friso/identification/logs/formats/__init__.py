"""Formats of logs: a table of all, by name, with what each is."""

from __future__ import annotations

from friso.identification.logs.formats import mat, twincat, uff
from friso.identification.logs.formats.libraries import (
    JSON_COLUMNS,
    LVM,
    NUMPY_ARRAYS,
    PARQUET,
    SPREADSHEET,
    TDMS,
    TEXT,
)
from friso.identification.logs.read import LogFormat

TABLE: dict[str, tuple[LogFormat, str]] = {
    "json-columns": (JSON_COLUMNS, "JSON: lists of numbers by name, a list of records or rows, or one record a line"),
    "lvm": (LVM, "LVM, the measurement text of LabVIEW"),
    "mat": (
        mat.FORMAT,
        "MATLAB files, up to version 7 (scipy) and 7.3 (HDF5): arrays, structures with time, dSPACE recordings",
    ),
    "numpy-arrays": (
        NUMPY_ARRAYS,
        "Arrays of NumPy, NPY and NPZ: one column each, or a matrix with a column for each channel",
    ),
    "parquet": (PARQUET, "Parquet and Feather (Arrow): tables in columns"),
    "spreadsheet": (
        SPREADSHEET,
        "Workbooks of Excel (XLSX, XLS) and OpenDocument (ODS): the table on the largest sheet",
    ),
    "tdms": (TDMS, "TDMS of National Instruments"),
    "text": (TEXT, "CSV, TXT and TSV: one table of numbers, of any delimiter, decimal sign and encoding; packed, too"),
    "twincat": (
        twincat.FORMAT,
        "TwinCAT Scope CSV export: rows of keys, then a time column and value columns per group of channels",
    ),
    "uff": (
        uff.FORMAT,
        "Universal files, dataset 58 (functions at nodal degrees of freedom): time histories and frequency responses",
    ),
}
