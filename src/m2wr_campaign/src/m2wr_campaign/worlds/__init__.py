# SPDX-License-Identifier: BSD-3-Clause
"""Generated worlds with a start and a goal, the same for a seed."""
