# SPDX-License-Identifier: BSD-3-Clause
"""Use of rospy's private parts and of Linux interfaces that rospy does not offer, one file for each.

Each file states the need, the versions it was checked against, and what happens where the private part is missing.
No other code of the workspace uses private parts of rospy; ``test_layers.py`` checks that.
``test_internals_rospy.py`` fails if rospy changes one of them.  rospy 1.15.15 (Debian 12) and 1.16.0 (Noetic) were
compared file by file, 13 files: one error text differs.
"""
