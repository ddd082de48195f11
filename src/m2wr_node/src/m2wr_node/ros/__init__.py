# SPDX-License-Identifier: BSD-3-Clause
"""The part of it that imports ROS."""
