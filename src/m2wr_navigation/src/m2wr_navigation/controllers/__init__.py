# SPDX-License-Identifier: BSD-3-Clause
"""Local planners: the next velocity command along a path."""
