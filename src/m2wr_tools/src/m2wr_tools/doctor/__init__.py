# SPDX-License-Identifier: BSD-3-Clause
"""Looks at a machine and at a running system, and says what is wrong and what to do about it.

Only the standard library is imported before a check needs more, so that it also runs where something is missing.
"""
