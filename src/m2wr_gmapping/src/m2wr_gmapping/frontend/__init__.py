# SPDX-License-Identifier: BSD-3-Clause
"""Scans and their matching with a map: from ranges to the pose of the newest scan."""
from m2wr_gmapping import tuning
from m2wr_maps import linear_kernels, pose_kernels
from m2wr_node import kernel_cache

kernel_cache.refresh(__file__, tuning.KERNEL_MODULES, tuning.read_by, (linear_kernels.__file__, pose_kernels.__file__))
