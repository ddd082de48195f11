# SPDX-License-Identifier: BSD-3-Clause
"""The BARN benchmark: fields of cylinders by a cellular automaton, drives through them, score and page."""
