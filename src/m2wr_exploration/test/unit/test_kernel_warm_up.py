# SPDX-License-Identifier: BSD-3-Clause
"""Nothing is compiled once the kernels are warm, so that the node does not compile while the robot drives."""
import numpy as np

from exploration_grids import World
from m2wr_exploration.explorer import PARAMETERS, Explorer
from m2wr_exploration.kernel_warm_up import compile_kernels
from m2wr_exploration.registry import STRATEGIES, find
from m2wr_exploration.team.map_match import match
from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.parameters import read
from m2wr_node.kernel_progress import kernels


def compiled():
    """Return the signatures of each kernel; those of a module's own are part of the ones that call them."""
    return {name: len(kernel.signatures) for name, kernel in kernels("m2wr_exploration").items()
            if not name.rpartition(".")[2].startswith("_")}


def test_exploration_compiles_nothing_after_the_warm_up():
    compile_kernels()
    before = compiled()
    assert len(before) == 12 and all(before.values())
    values = read(PARAMETERS, {"robot_radius": 0.3, "min_frontier_size": 0.0}, "~")[0]
    for name in STRATEGIES:
        kind, world = find(name), World("........\n" * 8)
        made = Explorer(values, kind(read(kind.PARAMETERS, {}, "~")[0]))
        for now, place in enumerate(((0.5, 0.5), (2.0, 2.0))):
            world.see(*place)
            made.step(float(now), world.known, np.array([*place, 0.0]), "aborted" if now else "")
    costs = np.full((100, 100), LETHAL, np.uint8)
    costs[5:95, 5:95] = 0
    room = Costmap(costs, 0.05, np.zeros(2), "map")
    assert match(room, room).wall > 0.0
    assert compiled() == before
