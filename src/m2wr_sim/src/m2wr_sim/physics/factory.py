# SPDX-License-Identifier: BSD-3-Clause
"""Selects the physics engine."""
from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Set

from m2wr_sim.engine_names import ENGINES
from m2wr_sim.errors import ParameterError
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.pyode_engine import PyodeEngine

if TYPE_CHECKING:
    from m2wr_sim.physics.engine import Engine, EngineSettings

log = logging.getLogger(__name__)

_logged: Set[str] = set()         # reasons why the compiled loop cannot be used, as logged by this process


def make_engine(kind: str, settings: EngineSettings) -> Engine:
    """Make an engine.

    Parameters
    ----------
    kind : str
        ``native``: the compiled loop.  ``pyode``: the Python loop, with the same numbers but slower.  ``auto``: the
        compiled loop if numba and libode are available, else the Python loop, with one warning.
    settings : EngineSettings

    Returns
    -------
    Engine

    Raises
    ------
    ParameterError
        If ``native`` is not available, or ``kind`` is none of these.
    """
    if kind not in ENGINES:
        raise ParameterError("engine %r: expected one of %s" % (kind, ", ".join(ENGINES)))
    if kind == "pyode":
        return PyodeEngine(settings)
    try:
        native_ode.publish_symbols()
        from m2wr_sim.physics.native_engine import NativeEngine
    except (ImportError, OSError, RuntimeError) as error:
        if kind == "native":
            raise ParameterError("engine native: the compiled loop cannot be used here (%s); expected numba and libode"
                                 % error) from error
        if str(error) in _logged:
            return PyodeEngine(settings)
        _logged.add(str(error))
        log.warning("the compiled physics loop cannot be used here (%s); the Python loop gives the same numbers, but "
                    "slower", error)
        return PyodeEngine(settings)
    return NativeEngine(settings)
