# SPDX-License-Identifier: BSD-3-Clause
"""Students' packages over hidden worlds."""
