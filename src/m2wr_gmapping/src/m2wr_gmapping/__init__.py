# SPDX-License-Identifier: BSD-3-Clause
"""Grid mapping with a Rao-Blackwellised particle filter; ROS-free except for the layer ``ros``."""
