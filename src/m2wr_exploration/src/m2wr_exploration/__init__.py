# SPDX-License-Identifier: BSD-3-Clause
"""Exploration of unknown areas by frontiers."""
