# SPDX-License-Identifier: BSD-3-Clause
"""What a page shows, from messages; without ROS and without a server."""
