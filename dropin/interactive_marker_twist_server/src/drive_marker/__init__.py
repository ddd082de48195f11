# SPDX-License-Identifier: BSD-3-Clause
"""Velocity commands from a marker."""
