# SPDX-License-Identifier: BSD-3-Clause
"""How long the parts of navigation take."""
