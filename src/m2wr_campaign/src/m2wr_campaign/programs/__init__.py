# SPDX-License-Identifier: BSD-3-Clause
"""ROS programs under test: started in limits, in lockstep with a simulation, with a master of their own."""
