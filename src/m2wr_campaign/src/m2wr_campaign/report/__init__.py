# SPDX-License-Identifier: BSD-3-Clause
"""The page of a study: one file of HTML that needs no network."""
