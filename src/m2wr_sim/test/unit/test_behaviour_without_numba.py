# SPDX-License-Identifier: BSD-3-Clause
"""Without numba everything runs in Python, with the same numbers and one warning."""
import json
import os
import subprocess
import sys

import pytest

from conftest import SOURCE
from m2wr_sim.api import Sim

DRIVE = """
import json, logging, sys
lines = []
handler = logging.Handler(logging.WARNING)
handler.emit = lambda record: lines.append(record.getMessage())
logging.getLogger("m2wr_sim").addHandler(handler)
from m2wr_sim.api import Sim
for again in range(2):
    with Sim("world01", "m2wr", pose=(0, 0, 0.3), seed=3) as sim:
        now = sim.step((0.4, 0.2), 1.0)
        engine = type(sim.simulator.engine).__name__
print(json.dumps([engine, now.pose, now.scan.ranges.tolist(), sum("compiled" in line for line in lines)]))
"""


@pytest.fixture
def without_numba(tmp_path):
    """Return an environment in which numba cannot be imported."""
    (tmp_path / "numba").mkdir()
    (tmp_path / "numba" / "__init__.py").write_text("raise ImportError('numba is kept away')\n")
    path = os.pathsep.join([str(tmp_path), str(SOURCE)] + sys.path)
    return dict(os.environ, PYTHONPATH=path)


def test_the_same_drive_without_numba(without_numba):
    done = subprocess.run([sys.executable, "-c", DRIVE], env=without_numba, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True, timeout=120)
    assert done.returncode == 0, done.stderr
    engine, pose, ranges, told = json.loads(done.stdout.splitlines()[-1])
    assert engine == "PyodeEngine" and told == 1
    with Sim("world01", "m2wr", pose=(0, 0, 0.3), seed=3) as sim:
        now = sim.step((0.4, 0.2), 1.0)
    assert tuple(pose) == tuple(now.pose)
    assert ranges == pytest.approx(now.scan.ranges.tolist(), abs=1e-9)
