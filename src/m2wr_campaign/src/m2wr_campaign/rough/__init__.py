# SPDX-License-Identifier: BSD-3-Clause
"""Robots on rough ground: drives on growing roughness, and what became of them."""
