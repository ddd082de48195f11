# SPDX-License-Identifier: BSD-3-Clause
"""Drive laws, on plain numbers."""
