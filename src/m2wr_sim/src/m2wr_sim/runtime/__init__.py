# SPDX-License-Identifier: BSD-3-Clause
"""The simulation loop, its clock and its schedule; no ROS, no wall clock."""
