# SPDX-License-Identifier: BSD-3-Clause
"""Files that are complete or unchanged, confined to a folder, and checked when read; imports no other package."""
