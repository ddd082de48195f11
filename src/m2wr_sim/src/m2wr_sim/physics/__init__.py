# SPDX-License-Identifier: BSD-3-Clause
"""The ODE world: bodies, joints, contacts."""
from m2wr_node import kernel_cache
from m2wr_sim.physics.ode_binding import find_ode

kernel_cache.refresh(__file__)
find_ode()
