# SPDX-License-Identifier: BSD-3-Clause
"""What every node of this workspace needs to start, to end, and to read its parameters; imports none of the others."""
