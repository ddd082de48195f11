# SPDX-License-Identifier: BSD-3-Clause
"""The services and command topics of Gazebo under ``/gazebo``: one class for each group, one table of names."""
