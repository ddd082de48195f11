# SPDX-License-Identifier: BSD-3-Clause
"""Robots deliver parcels over rough, unknown ground, with batteries, one charger and a radio of limited range."""
