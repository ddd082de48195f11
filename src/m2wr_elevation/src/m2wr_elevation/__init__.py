# SPDX-License-Identifier: BSD-3-Clause
"""Heights of the ground around a robot, and where it can drive."""
