# SPDX-License-Identifier: BSD-3-Clause
"""Package look-up under the module name that the xacro module imports, by ROS 1's package path."""
