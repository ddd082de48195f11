# SPDX-License-Identifier: BSD-3-Clause
"""Several robots: their maps merged, placed on each other without known start poses, frontiers shared out."""
