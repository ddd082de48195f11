# SPDX-License-Identifier: BSD-3-Clause
"""What a study is: its file, its factors, its runs."""
