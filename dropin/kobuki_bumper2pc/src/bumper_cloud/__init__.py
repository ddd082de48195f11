# SPDX-License-Identifier: BSD-3-Clause
"""Points for what bumper and cliff sensors find."""
