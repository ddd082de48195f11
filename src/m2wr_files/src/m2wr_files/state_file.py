# SPDX-License-Identifier: BSD-3-Clause
"""Container of a saved state: a zip archive of JSON and plain arrays, checked before memory is allocated.

``state.json`` holds numbers and words, every ``NAME.npy`` one array: ``numpy.load`` of a ``.npz`` opens it too. Nothing
in such a file is evaluated, and no class is named in it.
"""
from __future__ import annotations

import json
import math
import os
import re
import stat
import struct
import zipfile
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO, Dict, List, Mapping, Tuple

import numpy as np

from m2wr_files.atomic_files import write_atomically

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_FILE = 1 << 30                 # [byte]
MOST_UNPACKED = 1 << 30             # of all members together [byte]
MOST_JSON = 1 << 20                 # of state.json [byte]
MOST_MEMBERS = 200
MOST_DIRECTORY = 64 * 1024          # of the archive's list of members [byte]
MOST_DIGITS = 50                    # of a whole number in JSON; a generator's state has 39
MOST_DEPTH = 20                     # of JSON
DTYPES = ("float64", "float32", "int64", "int32", "uint16", "uint8", "int8", "bool")

_JSON, _HEADER = "state.json", re.compile(
    rb"\{'descr': '([<|][a-z][0-9]{1,2})', 'fortran_order': False, 'shape': \(([0-9, ]{0,80})\), \} *\n")
_END, _END_SIZE = struct.Struct("<4s4H2LH"), 22
_TYPES = {np.dtype(name).newbyteorder("<").str: np.dtype(name) for name in DTYPES}


class StateError(ValueError):
    """A state file cannot be written or used; says which one and why."""


@dataclass(frozen=True)
class Format:
    """What the states of one program have in common.

    Attributes
    ----------
    name : str
        Stored in each state. A file that begins with it and a line break is a pickle of an old version.
    version : int
        Stored in each state; no other version is read.
    program : str
        Name of the program, for messages.
    instead : str
        What the user can do with a state of an old version, for messages.
    """

    name: str
    version: int
    program: str
    instead: str

    @property
    def wanted(self) -> str:
        """What is expected of a file, for messages."""
        return "expected a state that {} saved".format(self.program)


class _Parts:
    """Collects the output of zipfile for ``write_atomically``."""

    def __init__(self) -> None:
        self.parts: List[bytes] = []
        self._at = 0

    def write(self, data: bytes) -> int:
        self.parts.append(bytes(data))
        self._at += len(self.parts[-1])
        return len(self.parts[-1])

    def tell(self) -> int:
        return self._at

    def flush(self) -> None:
        pass

    def close(self) -> None:
        pass


def write(path: str, kind: Format, document: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write a state atomically.

    Parameters
    ----------
    path : str
    kind : Format
    document : dict
        Content of ``state.json``; ``format`` and ``version`` are added.
    arrays : dict of str to ndarray
        Of the types in ``DTYPES``.

    Raises
    ------
    StateError
        If the file cannot be written.
    """
    document = dict(document, format=kind.name, version=kind.version)
    stream = _Parts()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr(_JSON, json.dumps(document, indent=1))
        for name, array in arrays.items():
            with archive.open(name + ".npy", "w") as member:
                np.lib.format.write_array_header_1_0(member, np.lib.format.header_data_from_array_1_0(array))
                member.write(np.ascontiguousarray(array).data.cast("B") if array.size else b"")
    try:
        write_atomically((path, stream.parts))
    except OSError as error:
        raise StateError("cannot write the state {}: {}; what was there before is kept".format(
            path, error.strerror or error)) from error


def read(path: str, kind: Format) -> Tuple[Dict[str, Any], Dict[str, NDArray[Any]]]:
    """Return the document and the arrays in a file.

    Parameters
    ----------
    path : str
    kind : Format
        The expected one.

    Returns
    -------
    document : dict
    arrays : dict of str to ndarray
        Each with memory of its own.

    Raises
    ------
    StateError
        If the file is missing, no state, damaged, of another version or too large.
    """
    try:
        with _opened(path, kind) as stream:
            _check_ends(stream, kind)
            with zipfile.ZipFile(stream) as archive:
                members = _members(archive, kind)
                document = _document(archive, members, kind)
                arrays = {name[:-4]: _array(archive, info) for name, info in members.items() if name != _JSON}
    except StateError as error:
        raise StateError("{}: {}".format(path, error)) from error
    except OSError as error:
        raise StateError("cannot read the state {}: {}".format(path, error.strerror or error)) from error
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError,
            struct.error) as error:
        raise StateError("{}: the file is damaged or cut off: {}".format(path, str(error)[:200])) from error
    except MemoryError:
        raise StateError("{}: not enough memory to load it".format(path)) from None
    return document, arrays


def _opened(path: str, kind: Format) -> BinaryIO:
    """Open a regular file; reading a pipe or device could block."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | getattr(os, "O_CLOEXEC", 0))
    found = os.fstat(descriptor)
    if not stat.S_ISREG(found.st_mode):
        os.close(descriptor)
        raise StateError("is no regular file; {}".format(kind.wanted))
    if found.st_size > MOST_FILE:
        os.close(descriptor)
        raise StateError("{} bytes; expected at most {}".format(found.st_size, MOST_FILE))
    return os.fdopen(descriptor, "rb")


def _check_ends(stream: BinaryIO, kind: Format) -> None:
    """Raise StateError unless a file begins and ends as an archive with few members does."""
    pickles = kind.name.encode() + b"\n"
    begin = stream.read(len(pickles) + 1000)
    if begin.startswith(pickles):
        found = re.search(rb'"version": ?([0-9]{1,5})', begin)
        raise StateError("a state of {}: it is a pickle, which can run code when it is read, and is not read any more. "
                         "This program reads version {} only: {}".format(
                             "version " + found.group(1).decode() if found else "an old version", kind.version,
                             kind.instead))
    if not begin.startswith(b"PK\3\4"):
        raise StateError("begins with {!r}; {}".format(begin[:20], kind.wanted))
    size = stream.seek(0, os.SEEK_END)
    if size < 2 * _END_SIZE:
        raise StateError("the file is damaged or cut off: {} bytes".format(size))
    stream.seek(size - _END_SIZE - 20)
    locator, end = stream.read(20), stream.read(_END_SIZE)
    magic, _, _, _, count, directory, _, comment = _END.unpack(end)
    if magic != b"PK\5\6" or comment or locator.startswith(b"PK\6\7"):
        raise StateError("the file is damaged or cut off: its list of members is not at its end")
    if count > MOST_MEMBERS or directory > MOST_DIRECTORY:
        raise StateError("{} members listed in {} bytes; expected at most {} in {}".format(
            count, directory, MOST_MEMBERS, MOST_DIRECTORY))
    stream.seek(0)


def _members(archive: zipfile.ZipFile, kind: Format) -> Dict[str, zipfile.ZipInfo]:
    """Return the archive's members by name, after a check of their declared sizes."""
    members: Dict[str, zipfile.ZipInfo] = {}
    total = 0
    for info in archive.infolist():
        name = info.filename
        if name in members or not (name == _JSON or re.fullmatch(r"[a-z_A-Z0-9.]{1,100}\.npy", name)):
            raise StateError("member {!r}: expected {} and NAME.npy, once each".format(name[:100], _JSON))
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or info.flag_bits & 1:
            raise StateError("member {}: packed in another way than by deflate".format(name))
        members[name] = info
        total += info.file_size
    if total > MOST_UNPACKED:
        raise StateError("{} bytes when unpacked; expected at most {}".format(total, MOST_UNPACKED))
    if _JSON not in members:
        raise StateError("no member {}; {}".format(_JSON, kind.wanted))
    return members


def _whole(text: str) -> int:
    if len(text) > MOST_DIGITS:
        raise StateError("{}: a number of {} digits; expected at most {}".format(_JSON, len(text), MOST_DIGITS))
    return int(text)


def _document(archive: zipfile.ZipFile, members: Mapping[str, zipfile.ZipInfo], kind: Format) -> Dict[str, Any]:
    info = members[_JSON]
    if info.file_size > MOST_JSON:
        raise StateError("{}: {} bytes; expected at most {}".format(_JSON, info.file_size, MOST_JSON))
    text = archive.read(info)
    depth = 0
    for byte in text:                   # brackets inside words count too: there are none in a state
        depth += (byte in b"[{") - (byte in b"]}")
        if depth > MOST_DEPTH:
            raise StateError("{}: nested more than {} deep".format(_JSON, MOST_DEPTH))
    document = json.loads(text.decode("utf-8"), parse_int=_whole)
    if not isinstance(document, dict) or document.get("format") != kind.name:
        raise StateError("{}: {}".format(_JSON, kind.wanted))
    if document.get("version") != kind.version:
        raise StateError("a state of version {!r:.20}; this program reads version {} only".format(
            document.get("version"), kind.version))
    return document


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    """Return the array in a member; memory is allocated after its size was checked."""
    with archive.open(info) as member:
        head = member.read(10)
        if head[:8] != b"\x93NUMPY\x01\x00" or len(head) != 10:
            raise StateError("member {}: expected an array of numpy's format 1.0".format(info.filename))
        length = int.from_bytes(head[8:], "little")
        found = _HEADER.fullmatch(member.read(length)) if length <= 1000 else None
        dtype = _TYPES.get(found.group(1).decode()) if found is not None else None
        if found is None or dtype is None:
            raise StateError("member {}: its type cannot be used; expected an array of one of {}".format(
                info.filename, ", ".join(DTYPES)))
        shape = tuple(int(part) for part in found.group(2).decode().replace(" ", "").split(",") if part)
        size = math.prod(shape) * dtype.itemsize
        if size != info.file_size - 10 - length or len(shape) > 4 or any(part > MOST_UNPACKED for part in shape):
            raise StateError("member {}: {} bytes for the shape {}".format(
                info.filename, info.file_size - 10 - length, shape))
        array = np.empty(shape, dtype)
        filled, view = 0, array.reshape(-1).view(np.uint8).data
        while filled < size:
            part = member.read(min(1 << 20, size - filled))
            if not part:
                raise StateError("member {}: cut off after {} of {} bytes".format(info.filename, filled, size))
            view[filled:filled + len(part)] = part
            filled += len(part)
        if member.read(1):              # reads on to the checksum
            raise StateError("member {}: longer than its shape".format(info.filename))
    if dtype == bool and size and array.view(np.uint8).max() > 1:
        raise StateError("member {}: expected bytes 0 and 1".format(info.filename))
    return array
