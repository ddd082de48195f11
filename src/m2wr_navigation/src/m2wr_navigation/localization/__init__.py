# SPDX-License-Identifier: BSD-3-Clause
"""Where the robot is on the map."""
