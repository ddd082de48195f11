# SPDX-License-Identifier: BSD-3-Clause
"""The particle filter: poses, weights, paths and maps of the particles, and the published grid."""
from m2wr_gmapping import tuning
from m2wr_node import kernel_cache

kernel_cache.refresh(__file__, tuning.KERNEL_MODULES, tuning.read_by)
