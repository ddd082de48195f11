# SPDX-License-Identifier: BSD-3-Clause
"""What libode says when it ends the process."""
import signal
import subprocess
import sys

import pytest

PROGRAM = """
import ctypes
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.model.types import Box, Collision, Inertial, Link, Model
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
box = Link("body", ((0, 0, 0), UPRIGHT), Inertial(1.0), (Collision("c", Box((1, 1, 1)), ((0, 0, 0), UPRIGHT)),))
engine = make_engine("pyode", EngineSettings())
for name in ("first", "second"):
    engine.add_model(Model(name, (box,), (), ((0, 0, 1), UPRIGHT)), ((0, 0, 1), UPRIGHT))
native_ode.library().%s(7, b"%%s failed in %%d places", b"a check", 3)
"""


@pytest.mark.parametrize("function, ending", [("dDebug", -signal.SIGABRT), ("dError", 1)])
def test_an_assertion_names_the_model_added_last(function, ending):
    done = subprocess.run([sys.executable, "-c", PROGRAM % function], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True, timeout=60)
    assert done.returncode == ending, done.stderr
    assert "libode ends this process: a check failed in 3 places (7)" in done.stderr
    assert 'The model added last is "second"' in done.stderr
