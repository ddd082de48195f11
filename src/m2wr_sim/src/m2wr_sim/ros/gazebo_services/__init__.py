# SPDX-License-Identifier: BSD-3-Clause
"""The services and command topics of Gazebo below ``/gazebo``: one class for each group, one table of names."""
