# SPDX-License-Identifier: BSD-3-Clause
"""Which engine steps the world."""
import logging

from m2wr_sim.engine_names import ENGINES
from m2wr_sim.errors import ParameterError
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.pyode_engine import PyodeEngine

log = logging.getLogger(__name__)

_told = set()           # reasons for which this process has gone without the compiled loop


def make_engine(kind, settings):
    """Make an engine.

    Parameters
    ----------
    kind : str
        ``native``: the compiled loop; ``pyode``: the Python loop, same numbers, slower; ``auto``: the compiled one
        where numba and libode allow, else the Python one, said once.
    settings : EngineSettings

    Raises
    ------
    ParameterError
        If ``native`` is asked for and cannot be had, or ``kind`` is none of these.
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
        if str(error) in _told:
            return PyodeEngine(settings)
        _told.add(str(error))
        log.warning("the compiled physics loop cannot be used here (%s); the Python loop gives the same numbers, but "
                    "slower", error)
        return PyodeEngine(settings)
    return NativeEngine(settings)
