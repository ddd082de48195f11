# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics of drives, with plain numbers."""
