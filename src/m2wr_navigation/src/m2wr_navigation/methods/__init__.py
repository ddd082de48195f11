# SPDX-License-Identifier: BSD-3-Clause
"""Methods that reach a goal without a map: scan and pose in, velocity command out."""
