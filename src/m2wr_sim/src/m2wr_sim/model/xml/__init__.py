# SPDX-License-Identifier: BSD-3-Clause
"""XML from files, topics and services: safe parsing, and repair of common mistakes."""
