# SPDX-License-Identifier: BSD-3-Clause
"""The message classes of the Kobuki base: apart from those of all plugins, because few robots need them."""
from __future__ import annotations

from typing import Any

from m2wr_sim.messages import find_message

BumperEvent: Any = find_message("kobuki_msgs.msg", "BumperEvent")
CliffEvent: Any = find_message("kobuki_msgs.msg", "CliffEvent")
MotorPower: Any = find_message("kobuki_msgs.msg", "MotorPower")
SensorState: Any = find_message("kobuki_msgs.msg", "SensorState")
WheelDropEvent: Any = find_message("kobuki_msgs.msg", "WheelDropEvent")
