# SPDX-License-Identifier: BSD-3-Clause
"""The decorator of every kernel: machine code from a library of the package, or from numba.

``make build`` compiles the kernels of a package into a shared library (:mod:`m2wr_node.kernel_library`).  A process
that finds this library does not import numba, which saves about 130 MiB of memory and most of its start.  numba
compiles at run time, as usual, where there is no library, where the library is of another version of the sources, of
Python or of the processor, and for arguments of other types than those in the library.
"""
from __future__ import annotations

import functools
import hashlib
import importlib.machinery
import importlib.util
import json
import logging
import os
import platform
import sys
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

OPTIONS: Dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
FORMAT = 1                              # of libraries and their descriptions
SWITCH = "M2WR_KERNEL_LIBRARY"          # environment variable; 0: libraries are not used
_CPU_INFO = "/proc/cpuinfo"
SCALARS: Dict[str, Tuple[type, ...]] = {
    "float64": (float, np.float64), "int64": (int, np.int64), "bool": (bool, np.bool_)}

logger = logging.getLogger(__name__)
before_numba: List[Callable[[], None]] = []     # what numba's cache needs before numba reads it, done once


class Variant(NamedTuple):
    """A kernel compiled for arguments of certain types.

    Attributes
    ----------
    arguments : int
        Number of arguments.
    arrays : list of (int, numpy.dtype, int, str)
        Index, type, number of dimensions and order (C or F) of each argument that is a contiguous, writable array.
    scalars : list of (int, tuple of type)
        Index and accepted types of each number.
    tuples : list of (int, list of tuple of type)
        Index and accepted types of each tuple of numbers.
    run : callable
        The compiled function.  It does not check the types itself.
    """

    arguments: int
    arrays: List[Tuple[int, Any, int, str]]
    scalars: List[Tuple[int, Tuple[type, ...]]]
    tuples: List[Tuple[int, List[Tuple[type, ...]]]]
    run: Callable[..., Any]

    def accepts(self, arguments: Tuple[Any, ...]) -> bool:
        """Return whether the types of the arguments are those of this variant."""
        if len(arguments) != self.arguments:
            return False
        for index, dtype, dimensions, order in self.arrays:
            array = arguments[index]
            if type(array) is not np.ndarray or array.ndim != dimensions:
                return False
            if not array.flags.carray if order == "C" else (array.flags.carray or not array.flags.farray):
                return False
            if array.dtype is not dtype and array.dtype != dtype:
                return False
        for index, types in self.scalars:
            if type(arguments[index]) not in types:
                return False
        for index, parts in self.tuples:
            found = arguments[index]
            if type(found) is not tuple or len(found) != len(parts) or any(
                    type(part) not in types for part, types in zip(found, parts)):
                return False
        return True


class Kernel:
    """A kernel of a library. It is called like a function that numba has compiled.

    Parameters
    ----------
    function : function
        The Python function.
    variants : list of Variant
        Empty for a kernel that only other kernels call.
    options : dict
        For numba.
    """

    def __init__(self, function: Callable[..., Any], variants: List[Variant], options: Dict[str, Any]) -> None:
        self.py_func, self._options = function, options
        self._variants = variants
        self._compiled: Any = None
        self.__doc__, self.__name__, self.__module__ = function.__doc__, function.__name__, function.__module__

    def __call__(self, *arguments: Any) -> Any:
        """Run the variant for these arguments; numba compiles a new one if there is none."""
        for variant in self._variants:
            if variant.accepts(arguments):
                return variant.run(*arguments)
        return self.dispatcher(*arguments)

    @property
    def signatures(self) -> List[Any]:
        """Combinations of types for which it is compiled, in the library or by numba; for tests that count them."""
        return [*self._variants, *(() if self._compiled is None else self._compiled.signatures)]

    @property
    def dispatcher(self) -> Any:
        """The same kernel, compiled by numba at run time."""
        if self._compiled is None:
            logger.debug("%s.%s: numba compiles it at run time", self.__module__, self.__name__)
            while before_numba:
                before_numba.pop()()
            self._compiled = _jit(self.py_func, self._options)
        return self._compiled

    @property
    def _numba_type_(self) -> Any:
        """What this name means inside another kernel that numba compiles."""
        return self.dispatcher._numba_type_


def kernel(function: Callable[..., Any]) -> Any:
    """Decorator: compile a function to machine code, without Python objects and without the interpreter's lock.

    Returns
    -------
    Kernel or numba dispatcher
        Both are callable and have the Python function as ``py_func``.
    """
    return _made(function, OPTIONS)


def fast_kernel(function: Callable[..., Any]) -> Any:
    """Decorator: like :func:`kernel`, but sums may be added up in another order, many terms at a time.

    Returns
    -------
    Kernel or numba dispatcher
    """
    return _made(function, dict(OPTIONS, fastmath=True))


def _made(function: Callable[..., Any], options: Dict[str, Any]) -> Any:
    library = loaded(package_folder(function))
    if library is None:
        return _jit(function, options)
    return Kernel(function, library.get(name_in_package(function), []), options)


def _jit(function: Callable[..., Any], options: Dict[str, Any]) -> Any:
    from numba import njit
    return njit(**options)(function)


def name_in_package(function: Callable[..., Any]) -> str:
    """Return the name of a function without that of its package, such as ``frontend.match_kernels.scratch``."""
    return "%s.%s" % (function.__module__.partition(".")[2], function.__name__)


def package_folder(function: Callable[..., Any]) -> str:
    """Return the folder with the sources of the top package that defines a function."""
    folder = os.path.abspath(function.__code__.co_filename)
    for _ in function.__module__.split(".")[1:]:
        folder = os.path.dirname(folder)
    return folder


# --------------------------------------------------------------------------------------------------------- libraries
_libraries: Dict[str, Optional[Dict[str, List[Variant]]]] = {}


def loaded(folder: str) -> Optional[Dict[str, List[Variant]]]:
    """Return the compiled kernels of the package with this folder of sources, None without a library that fits.

    Returns
    -------
    dict or None
        {name in the package: variants}
    """
    if folder not in _libraries:
        _libraries[folder] = _load(folder) if is_wanted() else None
    return _libraries[folder]


def is_wanted() -> bool:
    """Return whether libraries are to be used, by the environment."""
    return os.environ.get(SWITCH, "1") != "0" and os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")


def paths(folder: str) -> Tuple[str, str]:
    """Return the paths of the library and of its description, for the package with this folder of sources."""
    stem = os.path.join(folder, "__pycache__", module_name(os.path.basename(folder)))
    return stem + importlib.machinery.EXTENSION_SUFFIXES[0], stem + ".json"


def module_name(package: str) -> str:
    """Return the name of a package's library as a Python module."""
    return package + "_compiled"


@functools.lru_cache(maxsize=None)
def checksum(folder: str) -> str:
    """Return a checksum of what a library depends on: the sources of a package, Python, NumPy and the processor."""
    digest = hashlib.sha1(repr((FORMAT, sys.version, np.__version__, _processor())).encode())
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        for name in sorted(files):
            if name.endswith(".py"):
                path = os.path.join(place, name)
                with open(path, "rb") as stream:
                    digest.update(repr((os.path.relpath(path, folder), stream.read())).encode())
    return digest.hexdigest()


def _processor() -> Tuple[str, ...]:
    """Return model and features of the processor."""
    try:
        with open(_CPU_INFO) as stream:
            first = stream.read().partition("\n\n")[0]
    except OSError:
        return platform.machine(), platform.processor()
    return tuple(line for line in first.splitlines() if line.startswith(("model", "flags", "Features", "CPU part")))


def _load(folder: str) -> Optional[Dict[str, List[Variant]]]:
    library, description = paths(folder)
    try:
        with open(description) as stream:
            about = json.load(stream)
        if any(checksum(os.path.normpath(os.path.join(folder, source))) != expected
               for source, expected in about["sources"].items()):
            return None
        spec = importlib.util.spec_from_file_location(module_name(os.path.basename(folder)), library)
        if spec is None or spec.loader is None:
            return None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return {name: [_variant(types, getattr(module, symbol)) for symbol, types in found]
                for name, found in about["kernels"].items()}
    except FileNotFoundError:
        return None
    except (OSError, ImportError, AttributeError, LookupError, TypeError, ValueError) as error:
        logger.warning("the compiled kernels %s cannot be loaded (%s); numba compiles them at run time", library, error)
        return None


def _variant(types: List[Any], run: Callable[..., Any]) -> Variant:
    """Return the variant for types as :func:`m2wr_node.kernel_library.type_of` describes them."""
    variant = Variant(len(types), [], [], [], run)
    for index, found in enumerate(types):
        if isinstance(found, str):
            variant.scalars.append((index, SCALARS[found]))
        elif found[0] == "tuple":
            variant.tuples.append((index, [SCALARS[part] for part in found[1:]]))
        else:
            variant.arrays.append((index, np.dtype(found[0]), int(found[1]), str(found[2])))
    return variant
