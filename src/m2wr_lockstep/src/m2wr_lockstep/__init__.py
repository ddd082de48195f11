# SPDX-License-Identifier: BSD-3-Clause
"""Controllers in lockstep with a simulation."""
