# SPDX-License-Identifier: BSD-3-Clause
"""Nodes in place of nodelets whose C++ library is not there."""
