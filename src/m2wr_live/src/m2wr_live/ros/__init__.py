# SPDX-License-Identifier: BSD-3-Clause
"""The node: topics in, services out, and the replay of bags."""
