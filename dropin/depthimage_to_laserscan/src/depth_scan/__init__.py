# SPDX-License-Identifier: BSD-3-Clause
"""Laser scans from depth images."""
