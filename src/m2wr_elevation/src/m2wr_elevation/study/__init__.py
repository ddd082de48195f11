# SPDX-License-Identifier: BSD-3-Clause
"""Drives over generated ground: accuracy of the map, and planning over it against planning as if ground were flat."""
