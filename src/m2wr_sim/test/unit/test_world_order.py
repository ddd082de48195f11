# SPDX-License-Identifier: BSD-3-Clause
"""Worlds that the cycle collector frees: in an order in which libode crashes if nothing keeps them."""
from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import gc
import ode
from m2wr_sim.physics import world_order


class Owner:
    pass


gc.disable()
world = ode.World()
bodies = [ode.Body(world) for _ in range(100)]
owner = Owner()
owner.world, owner.cycle = world, owner
holder = list(bodies)           # the collector looks at it after the owner
holder.append(holder)
world_order.keep_until_collected(owner, world)
del world, bodies, owner, holder
assert gc.collect() > 0
assert not world_order._worlds
print("freed")
"""


def test_a_collected_world_is_freed_after_its_bodies():
    done = subprocess.run([sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          universal_newlines=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, "freed\n")
