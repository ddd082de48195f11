# SPDX-License-Identifier: BSD-3-Clause
"""Functions of libode that its Python binding does not have."""
from __future__ import annotations

import ctypes
import ctypes.util
import logging
import os
from typing import Any, Dict, Iterable, Optional, Set

log = logging.getLogger(__name__)

_HANDLER = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p)


def _load() -> Optional[ctypes.CDLL]:
    """Load libode by name: the same library as the binding uses, so that state and handles are shared."""
    for name in ("libode.so.8", ctypes.util.find_library("ode")):
        try:
            return ctypes.CDLL(name) if name else None
        except OSError:
            continue
    return None


_library = _load()
_published: Set[str] = set()        # names of libraries that compiled code can use


def publish_symbols() -> None:
    """Make the functions of libode available to compiled code.

    Raises
    ------
    ImportError
        If the compiler's library is missing, or libode cannot be loaded by name.
    """
    import llvmlite.binding
    if _library is None:
        raise ImportError("libode cannot be loaded by name")
    if _library._name not in _published:
        llvmlite.binding.load_library_permanently(_library._name)
        _published.add(_library._name)


try:
    publish_symbols()       # before any module with compiled calls is imported: without the symbols the compiler aborts
except ImportError:
    pass                    # make_engine tries again and reports the error


def library() -> Any:
    """Return libode with the signatures of functions for handles; None if it cannot be loaded by name."""
    if _library is not None:
        handle = ctypes.c_void_p
        for name, result, arguments in (
                ("dJointGroupCreate", handle, [ctypes.c_int]), ("dJointGroupDestroy", None, [handle]),
                ("dGeomGetBody", handle, [handle]), ("dBodyGetWorld", handle, [handle]),
                ("dGeomSetData", None, [handle, handle]), ("dSpaceGetNumGeoms", ctypes.c_int, [handle]),
                ("dGeomGetAABB", None, [handle, handle]), ("dGeomDestroy", None, [handle]),
                ("dCreateBox", handle, [handle] + 3 * [ctypes.c_double]),
                ("dBodyGetJoint", handle, [handle, ctypes.c_int]), ("dBodyGetNumJoints", ctypes.c_int, [handle]),
                ("dJointGetType", ctypes.c_int, [handle]), ("dSpaceClean", None, [handle]),
                ("dCollide", ctypes.c_int, [handle, handle, ctypes.c_int, handle, ctypes.c_int])):
            function = getattr(_library, name)
            function.restype, function.argtypes = result, arguments
    return _library


def clean_space(space: Any) -> None:
    """Compute the bounds of the new and moved geoms of a space now, not before its next collision test.

    Without libode by name it has no effect; the results are the same.
    """
    known = library()
    if known is not None:
        known.dSpaceClean(space._id())


def farthest(geoms: Iterable[Any]) -> float:
    """Return the greatest x or y, without its sign, of the bounds of geoms [m]; 0 without libode by name."""
    known, bounds = library(), (ctypes.c_double * 6)()
    found = 0.0
    for geom in geoms if known is not None else ():
        known.dGeomGetAABB(geom._id(), bounds)
        found = max(found, -bounds[0], bounds[1], -bounds[2], bounds[3])
    return found


class MessageCounter:
    """Counts the messages of ODE's solver instead of printing them: up to thousands of lines per second.

    ODE has one message handler per process, so all engines of a process share the count.
    """

    _count = 0
    _callback = None

    def __init__(self) -> None:
        if _library is None:
            log.warning("libode cannot be loaded by name: solver messages go to the terminal and are not counted")
        elif MessageCounter._callback is None:
            MessageCounter._callback = _HANDLER(_count_message)
            _library.dSetMessageHandler(MessageCounter._callback)

    @property
    def count(self) -> int:
        """Number of messages so far in this process."""
        return MessageCounter._count


def _count_message(number: int, text: bytes, _: Any) -> None:
    MessageCounter._count += 1
    log.debug("ODE message %d: %s", number, text)


_newest: Dict[str, Any] = {}        # name of the model added last, and the handler that prints it


def note_model(name: str) -> None:
    """Set the model that is named in the error message if an assertion of ODE aborts this process.

    ODE calls ``abort`` after its error handler, so the handler can only print a message.  ``physics.limits`` refuses
    models that are known to cause this.  ODE has one handler per process, so all engines of a process share the name.
    """
    _newest["name"] = str(name)
    if _library is not None and "handler" not in _newest:
        _newest["handler"] = _HANDLER(_print_error)
        _library.dSetDebugHandler(_newest["handler"])
        _library.dSetErrorHandler(_newest["handler"])


def _print_error(number: int, text: bytes, arguments: Any) -> None:
    message = ctypes.create_string_buffer(500)
    ctypes.pythonapi.PyOS_vsnprintf(message, ctypes.c_size_t(len(message)), ctypes.c_char_p(text),
                                    ctypes.c_void_p(arguments))
    # without logging, whose lock may be held
    os.write(2, b"libode ends this process: %s (%d). The model added last is \"%s\"; please report its description.\n"
             % (message.value, number, _newest["name"].encode("utf-8", "replace")))


def random_seed() -> int:
    """Return the state of the random sequence by which ODE's iterative solver orders its rows."""
    return 0 if _library is None else _library.dRandGetSeed() & 0xffffffff


def seed_random(seed: int) -> None:
    """Set the state of the random sequence by which ODE's iterative solver orders its rows."""
    if _library is not None:
        _library.dRandSetSeed(ctypes.c_ulong(seed & 0xffffffff))
