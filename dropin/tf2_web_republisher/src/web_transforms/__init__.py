# SPDX-License-Identifier: BSD-3-Clause
"""Transforms for web pages: sent when they have changed."""
