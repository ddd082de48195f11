# SPDX-License-Identifier: BSD-3-Clause
"""How well a map agrees with its world: the command ``compare_map``."""
