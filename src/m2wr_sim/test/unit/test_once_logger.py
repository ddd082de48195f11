# SPDX-License-Identifier: BSD-3-Clause
"""What is said of a robot: a warning only for what its reader can change, and each line once."""
import logging
from dataclasses import replace

import pytest

from m2wr_sim.api import Sim
from m2wr_sim.api.loading import read_robot
from m2wr_sim.runtime.once_logger import OnceLogger


@pytest.fixture
def lines(caplog):
    """Return a function that gives the lines of a level since it was last called."""
    caplog.set_level(logging.INFO, logger="m2wr_sim")

    def since(level):
        found = [record.getMessage() for record in caplog.records if record.levelno == level]
        caplog.clear()
        return found
    return since


@pytest.fixture
def fresh(monkeypatch):
    """As if no simulation had been in this process yet."""
    monkeypatch.setattr("m2wr_sim.api.sim._ONCE_LOGGER", OnceLogger())


@pytest.mark.parametrize("convention", ["rep103", "kinetic"])
def test_m2wr_gives_no_warning(fresh, lines, convention):
    Sim(robot="m2wr", wheel_convention=convention).close()
    assert lines(logging.WARNING) == []


def test_unsupported_elements_of_its_files_are_logged(fresh, lines):
    Sim(robot="m2wr").close()
    told = "\n".join(lines(logging.INFO))
    for words in ("<pose> in <link>", "<joint_properties>", "<surface> in a URDF collision",
                  "unsupported elements ignored: <torque>"):
        assert told.count(words) == 1, (words, told)


def test_a_reversed_robot_warns_once_in_a_hundred_simulations(fresh, lines):
    for _ in range(100):
        Sim(robot="m2wr", wheel_convention="noetic").close()
    told, = lines(logging.WARNING)
    assert "clockwise, against REP 103" in told


def test_a_line_is_logged_once_for_models_that_differ_by_name(fresh, lines):
    record = replace(read_robot("m2wr"), notes=("robot of first: strange.",))
    sim = Sim(robot=record)
    for name in ("second", "third"):
        sim.spawn(record, (0.0, float(len(name)), 0.0), name=name)
    sim.close()
    assert len(lines(logging.WARNING)) == 1


def test_another_line_is_said_and_memory_is_bounded(lines, monkeypatch):
    logger = OnceLogger()
    for text in ("a: x", "b: x", "a: y"):
        logger.log(logging.WARNING, text[0], "%s", text)
    assert lines(logging.WARNING) == ["a: x", "a: y"]
    monkeypatch.setattr("m2wr_sim.runtime.once_logger._MOST", 3)
    for number in range(10):
        logger.log(logging.WARNING, "", "%d", number)
    assert len(logger._lines) <= 3 and len(lines(logging.WARNING)) == 10
