# SPDX-License-Identifier: BSD-3-Clause
"""What the robot tries when it has no path or no command."""
