# SPDX-License-Identifier: BSD-3-Clause
"""Choose the best of many paths, drive it, and remember what was driven."""
