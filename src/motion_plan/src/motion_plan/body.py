# SPDX-License-Identifier: BSD-3-Clause
"""Dimensions of the robot for the guards, in the frame of link_chassis (x forward, y left), in metres."""

#: The wheels' axle: the robot rotates on the spot about this point.
AXLE_X = -0.05
#: The laser (joint_sensor_laser).
LASER_X = 0.15
#: Farthest point of the body from the axle: the tip of the (invisible) colliding caster at x = +0.40.
TURNING_RADIUS = 0.45
#: Parts of the footprint: rectangles (x_min, x_max, y_min, y_max) and discs (x, y, radius).
FOOTPRINT_BOXES = ((-0.25, 0.25, -0.15, 0.15), (-0.15, 0.05, 0.18, 0.22), (-0.15, 0.05, -0.22, -0.18))
FOOTPRINT_DISCS = ((0.35, 0.0, 0.05),)
