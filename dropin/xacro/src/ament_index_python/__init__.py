# SPDX-License-Identifier: BSD-3-Clause
"""Package look-up under the module name that the xacro module asks for, answered from ROS 1's package path."""
