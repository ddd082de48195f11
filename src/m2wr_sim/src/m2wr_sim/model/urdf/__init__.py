# SPDX-License-Identifier: BSD-3-Clause
"""URDF and xacro: text, checks, fixed joints merged, ``<gazebo>`` blocks, and the Model they make."""
