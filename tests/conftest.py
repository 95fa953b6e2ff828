"""Kernels of the test run are compiled into a folder of its own, which its worker processes share."""

import os
import shutil
import tempfile

import pytest

FOLDER = "FRISO_CACHE_DIR"
MADE = "FRISO_TEST_CACHE_DIR"


def pytest_configure(config: pytest.Config) -> None:
    """Before the workers start, so that they inherit the variable; a folder already chosen is kept and left."""
    if FOLDER not in os.environ:
        os.environ[FOLDER] = os.environ[MADE] = tempfile.mkdtemp(prefix="friso-tests-")


def pytest_unconfigure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput") and MADE in os.environ:
        shutil.rmtree(os.environ.pop(MADE), ignore_errors=True)
        os.environ.pop(FOLDER, None)
