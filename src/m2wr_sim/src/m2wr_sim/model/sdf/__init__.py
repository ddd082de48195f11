# SPDX-License-Identifier: BSD-3-Clause
"""SDF: worlds and models, one module for each group of elements."""
