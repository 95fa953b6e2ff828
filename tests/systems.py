"""Tests of what one family of systems has alone."""

import os

import pytest

posix = pytest.mark.skipif(os.name != "posix", reason="signals, permissions, links, pipes and devices of POSIX")
