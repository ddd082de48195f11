# SPDX-License-Identifier: BSD-3-Clause
"""Messages as plain values, and back."""
