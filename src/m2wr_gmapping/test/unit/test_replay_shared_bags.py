# SPDX-License-Identifier: BSD-3-Clause
"""Replay of two recordings that are no part of this workspace; the folder that has them is $M2WR_SLAM_DATA."""
import json
import lzma
import os
import subprocess
import sys

import numpy as np
import pytest

PACKAGE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
VARIABLE = "M2WR_SLAM_DATA"


def recording(name, folder):
    """Return the path of a bag, unpacked into ``folder`` if it is packed; skips the test where there is none."""
    if not os.environ.get(VARIABLE):
        return pytest.skip("{} is not set; expected the folder with {}".format(VARIABLE, name))
    path = os.path.join(os.environ[VARIABLE], name)
    if os.path.isfile(path):
        return path
    if os.path.isfile(path + ".xz"):
        unpacked = str(folder / name)
        with lzma.open(path + ".xz") as packed, open(unpacked, "wb") as stream:
            stream.write(packed.read())
        return unpacked
    return pytest.skip("{} has no {}, neither as it is nor as .xz".format(os.environ[VARIABLE], name))


# free share of the 4000 x 4000 cells: the bounds that users of these recordings know
@pytest.mark.parametrize("name, words, processed, low, high", [
    ("turtlebot.bag", ["_base_frame:=base_footprint"], (20, 40), 0.0005, 0.010),
    ("replay_crash.bag", [], (1, 2), 0.0001, 0.010),
])
def test_recorded_bag_gives_a_map_within_bounds(tmp_path, name, words, processed, low, high):
    bag, out, stats = recording(name, tmp_path), str(tmp_path / "map"), str(tmp_path / "stats.json")
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join(
        [os.path.join(PACKAGE, "src")] + os.environ.get("PYTHONPATH", "").split(os.pathsep)))
    done = subprocess.run(
        [sys.executable, os.path.join(PACKAGE, "nodes", "slam_gmapping_replay"), "--bag_filename", bag, "--quiet",
         "--map", out, "--stats", stats] + words, env=environment, timeout=120, universal_newlines=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == 0, done.stdout
    with open(stats, encoding="utf-8") as stream:
        assert processed[0] <= json.load(stream)["processed"] <= processed[1]
    with open(out + ".pgm", "rb") as stream:
        magic, _, size, _ = [stream.readline() for _ in range(4)]
        cells = np.frombuffer(stream.read(), np.uint8)
    assert (magic, size) == (b"P5\n", b"4000 4000\n")
    assert low <= np.mean(cells == 254) <= high
    assert np.count_nonzero(cells == 0) > 100
