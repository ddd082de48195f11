# SPDX-License-Identifier: BSD-3-Clause
"""Frees an ODE world after its bodies and joints.

libode frees the bodies and joints of a world with it; an object of the binding that is freed later then uses freed
memory.  Each such object refers to its world, so the order is right unless the cycle collector clears these references:
it does so in any order when it collects an engine that is part of a cycle.  At the end of the program Python clears
everything in any order, so a world that is still there then is not freed at all.
"""
from __future__ import annotations

import ctypes
import gc
import weakref
from typing import TYPE_CHECKING, Any, Dict, List

if TYPE_CHECKING:
    import ode

_worlds: List[ode.World] = []       # whose engine is being freed


def keep_until_collected(engine: Any, world: ode.World) -> None:
    """Keep a world until its engine is gone, and a collection in which this happens has ended.

    Parameters
    ----------
    engine : object
        The owner of the world; it may be part of a cycle.
    world : ode.World
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(world))
    weakref.finalize(engine, _worlds.append, world).atexit = False


def _release(phase: str, _: Dict[str, int]) -> None:
    while phase == "stop" and _worlds:
        ctypes.pythonapi.Py_DecRef(ctypes.py_object(_worlds.pop()))


gc.callbacks.append(_release)
