# SPDX-License-Identifier: BSD-3-Clause
"""Pages: the server, what it draws with viser, and what pages may ask for."""
