# SPDX-License-Identifier: BSD-3-Clause
"""The few calls of libode that its Python binding does not offer."""
import ctypes
import ctypes.util
import logging
import os

log = logging.getLogger(__name__)

_HANDLER = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p)


def _load():
    """Load libode by name: the very object the binding is linked to, so state and handles are shared."""
    for name in ("libode.so.8", ctypes.util.find_library("ode")):
        try:
            return ctypes.CDLL(name) if name else None
        except OSError:
            continue
    return None


_library = _load()


def publish_symbols():
    """Let compiled code call libode's functions by name.

    Raises
    ------
    ImportError
        If the compiler's library is missing, or libode cannot be loaded by name.
    """
    import llvmlite.binding
    if _library is None:
        raise ImportError("libode cannot be loaded by name")
    llvmlite.binding.load_library_permanently(_library._name)


try:
    publish_symbols()       # before any module with compiled calls is imported: without the symbols the compiler aborts
except ImportError:
    pass                    # asked again, and reported, by whoever needs them


def library():
    """Return libode with the signatures that handles need, or None where it cannot be loaded by name."""
    if _library is not None:
        handle = ctypes.c_void_p
        for name, result, arguments in (
                ("dJointGroupCreate", handle, [ctypes.c_int]), ("dJointGroupDestroy", None, [handle]),
                ("dGeomGetBody", handle, [handle]), ("dBodyGetWorld", handle, [handle]),
                ("dGeomSetData", None, [handle, handle]), ("dSpaceGetNumGeoms", ctypes.c_int, [handle]),
                ("dGeomGetAABB", None, [handle, handle]), ("dGeomDestroy", None, [handle]),
                ("dCreateBox", handle, [handle] + 3 * [ctypes.c_double]),
                ("dBodyGetJoint", handle, [handle, ctypes.c_int]), ("dBodyGetNumJoints", ctypes.c_int, [handle]),
                ("dJointGetType", ctypes.c_int, [handle])):
            function = getattr(_library, name)
            function.restype, function.argtypes = result, arguments
    return _library


class MessageCounter:
    """Counts what ODE's solver has to say instead of printing it, thousands of lines a second at worst.

    ODE has one handler per process, so all engines of a process share the count.
    """

    _count = 0
    _callback = None

    def __init__(self):
        if _library is None:
            log.warning("libode cannot be loaded by name: solver messages go to the terminal and are not counted")
        elif MessageCounter._callback is None:
            MessageCounter._callback = _HANDLER(_count_message)
            _library.dSetMessageHandler(MessageCounter._callback)

    @property
    def count(self):
        """Number of messages so far in this process."""
        return MessageCounter._count


def _count_message(number, text, _):
    MessageCounter._count += 1
    log.debug("ODE message %d: %s", number, text)


_newest = {}        # name of the model added last, and the handler that tells it


def note_model(name):
    """Let the last words of this process name a model, should an assertion of ODE end it.

    ODE calls ``abort`` when its handler returns, so the handler can only speak: ``physics.limits`` refuses beforehand
    what is known to lead there.  ODE has one handler per process, so all engines of a process share the name.
    """
    _newest["name"] = str(name)
    if _library is not None and "handler" not in _newest:
        _newest["handler"] = _HANDLER(_say_last_words)
        _library.dSetDebugHandler(_newest["handler"])
        _library.dSetErrorHandler(_newest["handler"])


def _say_last_words(number, text, arguments):
    message = ctypes.create_string_buffer(500)
    ctypes.pythonapi.PyOS_vsnprintf(message, ctypes.c_size_t(len(message)), ctypes.c_char_p(text),
                                    ctypes.c_void_p(arguments))
    # not by logging, whose lock may be held
    os.write(2, b"libode ends this process: %s (%d). The model added last is \"%s\"; please report its description.\n"
             % (message.value, number, _newest["name"].encode("utf-8", "replace")))


def random_seed():
    """Return where the random sequence is that ODE's iterative solver orders its rows by."""
    return 0 if _library is None else _library.dRandGetSeed() & 0xffffffff


def seed_random(seed):
    """Restart the random sequence that ODE's iterative solver orders its rows by."""
    if _library is not None:
        _library.dRandSetSeed(ctypes.c_ulong(seed & 0xffffffff))
