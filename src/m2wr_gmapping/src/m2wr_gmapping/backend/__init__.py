# SPDX-License-Identifier: BSD-3-Clause
"""Loop closing: place search, pose graph and steps by the newest calibration."""
from m2wr_gmapping import tuning
from m2wr_node import kernel_cache

kernel_cache.refresh(__file__, tuning.KERNEL_MODULES, tuning.read_by)
