# SPDX-License-Identifier: BSD-3-Clause
"""The controllers of ros_controllers; one module each, and one line in the registry."""
