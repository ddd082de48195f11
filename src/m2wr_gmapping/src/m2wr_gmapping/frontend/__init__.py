# SPDX-License-Identifier: BSD-3-Clause
"""Scans and their matching with a map: from ranges to the pose of the newest scan."""
