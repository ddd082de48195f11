# SPDX-License-Identifier: BSD-3-Clause
"""Localization on a known map by a particle filter (amcl); no ROS in here."""
