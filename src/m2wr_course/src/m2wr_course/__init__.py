# SPDX-License-Identifier: BSD-3-Clause
"""Checks of the exercises of the course in docs/."""
