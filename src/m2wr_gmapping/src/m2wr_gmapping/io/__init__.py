# SPDX-License-Identifier: BSD-3-Clause
"""Files: states, saved maps, and writing each file as a whole."""
