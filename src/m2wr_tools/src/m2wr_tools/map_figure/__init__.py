# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of maps: the command ``plot_map``."""
