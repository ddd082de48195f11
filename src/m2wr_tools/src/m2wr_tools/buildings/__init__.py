# SPDX-License-Identifier: BSD-3-Clause
"""Generated buildings: floor plans by seed, free paths through them, worlds in SDF."""
