# SPDX-License-Identifier: BSD-3-Clause
"""Runs on all cores, each with a time limit."""
