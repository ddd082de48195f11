# SPDX-License-Identifier: BSD-3-Clause
"""Limits on speed and acceleration of velocity commands."""
