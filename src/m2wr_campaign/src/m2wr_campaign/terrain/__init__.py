# SPDX-License-Identifier: BSD-3-Clause
"""Generated rough ground: heights by seed, patches with other friction, worlds in SDF, numbers and pictures."""
