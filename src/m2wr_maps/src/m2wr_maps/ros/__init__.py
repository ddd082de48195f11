# SPDX-License-Identifier: BSD-3-Clause
"""Messages of poses and grids, and scans with the transforms of their lasers as a node receives them."""
