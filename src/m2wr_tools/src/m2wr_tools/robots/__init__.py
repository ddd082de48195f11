# SPDX-License-Identifier: BSD-3-Clause
"""Robots of a running simulation: adding many, placing one from rviz, driving them at random."""
