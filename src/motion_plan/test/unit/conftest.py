# SPDX-License-Identifier: BSD-3-Clause
"""Let the tests find the package from the source tree as well."""
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(__file__), '..', '..', 'src'))
