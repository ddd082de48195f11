# SPDX-License-Identifier: BSD-3-Clause
"""Explorations in the simulator, measured against the true world."""
