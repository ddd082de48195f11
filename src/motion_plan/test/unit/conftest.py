# SPDX-License-Identifier: BSD-3-Clause
"""Makes the package of the source tree importable."""
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(__file__), '..', '..', 'src'))
