# SPDX-License-Identifier: BSD-3-Clause
"""Commands and functions for controller managers."""
