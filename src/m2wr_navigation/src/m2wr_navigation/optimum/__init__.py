# SPDX-License-Identifier: BSD-3-Clause
"""The exact shortest path through a known world: what every other path is compared with."""
