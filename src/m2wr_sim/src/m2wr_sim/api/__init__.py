# SPDX-License-Identifier: BSD-3-Clause
"""The simulator as a library: worlds, robots, commands and measurements as plain Python and numpy, without ROS running.

>>> from m2wr_sim.api import Sim
>>> with Sim("world02", "m2wr", pose=(0.0, 8.0, 0.0)) as sim:
...     now = sim.step((0.5, 0.0), 2.0)
...     now.pose, now.odometry.linear_x, now.scan.ranges.min(), now.contacts

:mod:`m2wr_tools.bug2_runner` drives Bug 2 in such a simulation; importing :mod:`m2wr_sim.api.gym_env` registers a
Gymnasium environment.
"""
from m2wr_sim.api.loading import read_robot, read_world
from m2wr_sim.api.records import Contact, Observation, Odometry, Picture, Scan, StepResult
from m2wr_sim.api.sim import Sim
from m2wr_sim.api.vector import VectorSim

__all__ = ["Observation", "Odometry", "Picture", "Scan", "Sim", "StepResult", "Contact", "VectorSim", "read_robot",
           "read_world"]
