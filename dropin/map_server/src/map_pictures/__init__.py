# SPDX-License-Identifier: BSD-3-Clause
"""Saved maps: reading their files, publishing them."""
