# SPDX-License-Identifier: BSD-3-Clause
"""The names by which an engine is chosen; imports nothing, for command lines."""

ENGINES = ("auto", "native", "pyode")
