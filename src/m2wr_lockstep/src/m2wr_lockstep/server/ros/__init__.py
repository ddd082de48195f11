# SPDX-License-Identifier: BSD-3-Clause
"""The parts of the simulator's side that use rospy."""
