# SPDX-License-Identifier: BSD-3-Clause
"""From robot and world descriptions (URDF, SDF) to plain records."""
