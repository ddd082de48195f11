# SPDX-License-Identifier: BSD-3-Clause
"""The height of the robot's laser, which is also where maps are compared with worlds."""

LASER_HEIGHT = 0.15         # of m2wr above the floor [m]
