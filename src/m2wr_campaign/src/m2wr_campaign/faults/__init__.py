# SPDX-License-Identifier: BSD-3-Clause
"""Faults of sensors and drives as a factor of a study: one file for each kind, one line each in ``registry``."""
