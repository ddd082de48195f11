# SPDX-License-Identifier: BSD-3-Clause
"""Nodes, messages, parameters of the server."""
