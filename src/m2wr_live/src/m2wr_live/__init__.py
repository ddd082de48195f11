# SPDX-License-Identifier: BSD-3-Clause
"""Live view of a simulation in web browsers."""
