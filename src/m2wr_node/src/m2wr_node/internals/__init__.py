# SPDX-License-Identifier: BSD-3-Clause
"""Use of rospy's private parts and of Linux interfaces that rospy does not offer, one file for each.

Each file states the need, the versions it was checked against, and what happens where the private part is missing.
``m2wr_node.ros.starting``, ``m2wr_node.ros.acceptor`` and ``m2wr_sim.ros.transport`` use private parts too and are not
moved here yet.
"""
