# SPDX-License-Identifier: BSD-3-Clause
"""Driving a Kobuki back from what its bumper or its cliff sensors find."""
