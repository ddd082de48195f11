# SPDX-License-Identifier: BSD-3-Clause
"""Description of the machine on which figures were measured."""
from __future__ import annotations

import os
import platform
from typing import Any, Dict

import numpy

_UNKNOWN = "unknown"


def _first(path: str, key: str) -> str:
    try:
        with open(path, encoding="utf-8") as stream:
            for line in stream:
                name, _, value = line.partition(":" if ":" in line else "=")
                if name.strip() == key:
                    return value.strip().strip('"')
    except OSError:
        pass
    return _UNKNOWN


def numba_version() -> str:
    """Return numba's version, or ``none``."""
    try:
        import numba
    except ImportError:
        return "none"
    return numba.__version__


def describe() -> Dict[str, Any]:
    """Return a dictionary of processor, cores, system and versions."""
    return {"processor": _first("/proc/cpuinfo", "model name"), "cores": os.cpu_count(),
            "load": "%.1f" % os.getloadavg()[0], "system": _first("/etc/os-release", "PRETTY_NAME"),
            "python": platform.python_version(), "numpy": numpy.__version__, "numba": numba_version()}


def sentence(machine: Dict[str, Any]) -> str:
    """Return the description as one sentence."""
    return ("%(processor)s, %(cores)s cores (load of the machine meanwhile: %(load)s), %(system)s, "
            "Python %(python)s, numpy %(numpy)s, numba %(numba)s" % machine)
