# SPDX-License-Identifier: BSD-3-Clause
"""Laser logs made by the simulator, with ground truth, for the development and the examination of a mapper."""
