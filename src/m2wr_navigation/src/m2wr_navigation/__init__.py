# SPDX-License-Identifier: BSD-3-Clause
"""Navigation on a map: costmaps, planners, controllers, localization. Only the modules in ``ros`` need ROS."""
