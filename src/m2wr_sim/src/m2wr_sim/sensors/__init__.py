# SPDX-License-Identifier: BSD-3-Clause
"""Sensor models, with plain arrays."""
from m2wr_node import kernel_cache

kernel_cache.refresh(__file__)
