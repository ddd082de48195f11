# SPDX-License-Identifier: BSD-3-Clause
"""Collisions of a robot as a topic."""
