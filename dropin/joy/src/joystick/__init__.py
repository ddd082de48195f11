# SPDX-License-Identifier: BSD-3-Clause
"""Messages of a joystick."""
