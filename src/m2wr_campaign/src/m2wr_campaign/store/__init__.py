# SPDX-License-Identifier: BSD-3-Clause
"""Results in one SQLite file."""
