# SPDX-License-Identifier: BSD-3-Clause
"""The simulator's side of lockstep: it asks controllers for turns and waits for replies and listeners. ROS-free."""
