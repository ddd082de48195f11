# SPDX-License-Identifier: BSD-3-Clause
"""The ODE world: bodies, joints, contacts."""
from m2wr_node import kernel_cache

kernel_cache.refresh(__file__)
