# SPDX-License-Identifier: BSD-3-Clause
"""Stops the cycle collector while a world is built: it would look at all new objects many times and free none."""
from __future__ import annotations

import contextlib
import gc
from typing import Iterator


@contextlib.contextmanager
def paused_collector() -> Iterator[None]:
    """Stop the cycle collector for a while, unless it is stopped already."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
