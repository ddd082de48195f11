# SPDX-License-Identifier: BSD-3-Clause
"""The particle filter: poses, weights, paths and maps of the particles, and the published grid."""
