"""The real browser of this machine, in which tests/test_app_browser.py looks at pages."""

import shutil

import pytest

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")

needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
