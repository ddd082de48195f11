# SPDX-License-Identifier: BSD-3-Clause
"""Websocket server whose clients are sent what they can read, and no more."""
