# SPDX-License-Identifier: BSD-3-Clause
"""The robot m2wr and models made in one line; the makers of models are those of m2wr_sim's tests."""
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

_SOURCES = Path(__file__).resolve().parents[3]
sys.path.append(str(_SOURCES / "m2wr_sim" / "test" / "unit"))
sys.path.insert(0, str(_SOURCES / "m2wr_tools" / "src"))    # for a plain pytest run; catkin leads to the same files

import builders  # noqa: E402
from m2wr_sim.api.loading import read_robot  # noqa: E402


@pytest.fixture(scope="session")
def m2wr():
    """Return the report's robot, read from its xacro."""
    return read_robot("m2wr")


@pytest.fixture(scope="session")
def build():
    """Return the functions that make models."""
    return SimpleNamespace(at=builders.at, one_link=builders.one_link, ground=builders.ground, box=builders.box,
                           sphere=builders.sphere, cylinder=builders.cylinder)
