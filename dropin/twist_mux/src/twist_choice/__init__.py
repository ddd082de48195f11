# SPDX-License-Identifier: BSD-3-Clause
"""Choice between velocity commands by priority."""
