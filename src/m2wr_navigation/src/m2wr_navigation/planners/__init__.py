# SPDX-License-Identifier: BSD-3-Clause
"""Global planners: a path over the whole map."""
