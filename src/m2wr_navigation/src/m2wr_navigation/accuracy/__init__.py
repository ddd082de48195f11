# SPDX-License-Identifier: BSD-3-Clause
"""Drives to random goals with the whole of navigation in one process, measured against the truth."""
