# SPDX-License-Identifier: BSD-3-Clause
"""Motion planning of the m2wr robot: the report's behaviours as state machines, and the ROS nodes around them."""
