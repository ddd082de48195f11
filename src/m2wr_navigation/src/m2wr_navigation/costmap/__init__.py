# SPDX-License-Identifier: BSD-3-Clause
"""Grids of costs, and the layers that fill them."""
