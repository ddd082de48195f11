# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a world for cameras: colour and depth, computed on the processor, with plain arrays.

A picture is made in two passes.  First the nearest surface of each pixel is found (:mod:`raster_kernels`), then each
pixel is coloured once (:mod:`shade_kernels`), with shadows from rays to the light (:mod:`shadow_kernels`).
"""
import os

from m2wr_node import kernel_cache

# these kernels call functions of that module
_BASE_KERNELS = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "sensors", "base_kernels.py")
kernel_cache.refresh(__file__, used=(_BASE_KERNELS,))
