# SPDX-License-Identifier: BSD-3-Clause
"""Meshes: files, outlines and heightmaps as triangles, and the elements that name them."""
