# SPDX-License-Identifier: BSD-3-Clause
"""Loop closing: place search, pose graph and steps by the newest calibration."""
