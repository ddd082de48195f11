# SPDX-License-Identifier: BSD-3-Clause
"""How accurate and how fast the mapping is on recorded logs: the command ``benchmark``."""
