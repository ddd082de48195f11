# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo plugins, one file each."""
