# SPDX-License-Identifier: BSD-3-Clause
"""Commands that work on results of several packages: nothing below imports this package."""
