# SPDX-License-Identifier: BSD-3-Clause
"""ros_control in simulation: joints with hardware interfaces, controllers, and the manager that runs them."""
