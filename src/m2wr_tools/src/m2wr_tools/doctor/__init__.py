# SPDX-License-Identifier: BSD-3-Clause
"""Checks a machine and a running system; reports faults and what to do about them.

Only the standard library is imported until a check needs more, so it also runs on an incomplete installation.
"""
