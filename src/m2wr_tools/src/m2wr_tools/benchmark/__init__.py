# SPDX-License-Identifier: BSD-3-Clause
"""How fast the simulation is: worlds to measure in, stop watches, and the command ``benchmark``."""
