# SPDX-License-Identifier: BSD-3-Clause
"""What makes a path good or bad: one file for each criterion."""
