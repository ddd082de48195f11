# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of robots and runs without a display."""
