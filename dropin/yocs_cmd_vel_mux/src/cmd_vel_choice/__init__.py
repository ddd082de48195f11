# SPDX-License-Identifier: BSD-3-Clause
"""Choice of velocity commands: the source with the highest priority."""
