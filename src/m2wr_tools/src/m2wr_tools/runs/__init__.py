# SPDX-License-Identifier: BSD-3-Clause
"""Runs: start and end one, record it, sum it up in a table."""
