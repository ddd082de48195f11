# SPDX-License-Identifier: BSD-3-Clause
"""The controller's side of lockstep: it takes a turn when the simulator asks for one."""
