# SPDX-License-Identifier: BSD-3-Clause
"""Reader of the messages of a ROS 1 bag in file order, for complete and damaged bags.

The index at the end is not used, so the bag of a killed recorder can be read up to its end.
"""
from __future__ import annotations

import bz2
import logging
import os
import struct
from typing import Callable, Dict, Iterator, NamedTuple, Optional, Tuple

MAGIC = b"#ROSBAG V2.0\n"
OP_MESSAGE, OP_CHUNK, OP_CONNECTION = 2, 5, 7
LARGEST_CHUNK = 2**30       # of a truncated file; a greater length is damaged

Fields = Dict[bytes, bytes]         # of a record header
log = logging.getLogger(__name__)


class Message(NamedTuple):
    """A message of a bag: its topic, the name of its type, and its serialised content."""

    topic: str
    type: str
    data: bytes


class BagError(OSError):
    """A file is no ROS 1 bag of format 2.0, or cannot be read."""


def _fields(header: bytes) -> Fields:
    """Return the fields of a record header."""
    fields: Fields = {}
    at = 0
    while at + 4 <= len(header):
        size = struct.unpack_from("<I", header, at)[0]
        name, _, value = header[at + 4:at + 4 + size].partition(b"=")
        fields[name] = value
        at += 4 + size
    return fields


def _lz4(data: bytes, size: int) -> bytes:
    import roslz4
    unpacked: bytes = roslz4.decompress(data) if size else b""
    return unpacked


def _unpacked(fields: Fields, data: bytes) -> bytes:
    """Return the records inside a chunk."""
    kind = fields.get(b"compression", b"none")
    if kind == b"none":
        return data
    if kind == b"bz2":
        return bz2.decompress(data)
    if kind == b"lz4":
        return _lz4(data, struct.unpack("<I", fields[b"size"])[0])
    raise BagError("compression {!r} of a chunk: expected none, bz2 or lz4".format(kind.decode(errors="replace")))


class _EndOfFile(BagError):
    """The file ends, or the start of the next record is unknown."""


def _is_plain_chunk(fields: Fields) -> bool:
    return fields.get(b"op") == bytes([OP_CHUNK]) and fields.get(b"compression", b"none") == b"none"


def _piece(records: bytes, at: int) -> Tuple[bytes, int]:
    """Return the bytes after the length at ``at``, and where they end."""
    size = struct.unpack_from("<I", records, at)[0]
    if at + 4 + size > len(records):
        raise BagError("a record in a chunk is longer than the chunk")
    return records[at + 4:at + 4 + size], at + 4 + size


class BagFile:
    """One bag, read from the beginning to the end.

    Parameters
    ----------
    path : str

    Attributes
    ----------
    topics : dict
        Topic -> type of all connections so far.
    damage : str or None
        Description of the first damage, once it was reached.
    fraction : float
        Share of the file that has been read.

    Raises
    ------
    BagError
        If the file cannot be opened or is no such bag.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        try:
            self._stream = open(path, "rb")
            self._size = os.fstat(self._stream.fileno()).st_size
            magic = self._stream.read(len(MAGIC))
        except OSError as error:
            raise BagError("{}: {}".format(path, error.strerror or error)) from error
        if magic != MAGIC:
            self._stream.close()
            raise BagError("{}: begins with {!r}; expected a ROS 1 bag, {!r}".format(path, magic[:13], MAGIC))
        self.topics: Dict[str, str] = {}
        self.damage: Optional[str] = None
        self.fraction = 0.0
        self._connections: Dict[bytes, Tuple[str, str]] = {}        # topic and type, by number

    def __enter__(self) -> BagFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def messages(self, wanted: Callable[[str], bool]) -> Iterator[Message]:
        """Yield a Message for each one of the topics for which ``wanted(topic)`` holds.

        Damaged parts are skipped: the rest of a chunk, or the rest of the file if the length of a record is wrong.
        ``damage`` then says where and why.
        """
        while True:
            at = self._stream.tell()
            try:
                record = self._record()
                if record is None:
                    return
                for message in self._inside(*record, wanted):
                    yield message
            except _EndOfFile as error:
                self._damaged(at, error)
                return
            except (BagError, OSError, ValueError, EOFError, LookupError, struct.error) as error:
                self._damaged(at, error)
            self.fraction = self._stream.tell() / max(1, self._size)

    def _damaged(self, at: int, error: object) -> None:
        if self.damage is None:
            self.damage = "{}: broken at byte {} of {}: {}".format(self._path, at, self._size, error)

    def _record(self) -> Optional[Tuple[Fields, bytes]]:
        """Return header fields and data of the next record, None at the end; of a truncated chunk the existing part."""
        at = self._stream.tell()
        head = self._stream.read(4)
        if not head:
            return None
        fields = _fields(self._exactly(struct.unpack("<I", head)[0] if len(head) == 4 else 4))
        if b"op" not in fields:
            raise _EndOfFile("no record")
        size = struct.unpack("<I", self._exactly(4))[0]
        if size > self._size - self._stream.tell() and size < LARGEST_CHUNK and _is_plain_chunk(fields):
            self._damaged(at, "the file ends in the middle of a chunk")
            size = self._size - self._stream.tell()
        return fields, self._exactly(size)

    def _exactly(self, size: int) -> bytes:
        if size > self._size:
            raise _EndOfFile("a length of {} bytes".format(size))
        data = self._stream.read(size)
        if len(data) != size:
            raise _EndOfFile("the file ends in the middle of a record")
        return data

    def _inside(self, fields: Fields, data: bytes, wanted: Callable[[str], bool]) -> Iterator[Message]:
        kind = fields[b"op"][0]
        if kind == OP_CHUNK:
            records, at = _unpacked(fields, data), 0
            while at + 8 <= len(records):
                header, at = _piece(records, at)
                content, at = _piece(records, at)
                for message in self._inside(_fields(header), content, wanted):
                    yield message
        elif kind == OP_CONNECTION:
            topic = fields[b"topic"].decode()
            self._connections[fields[b"conn"]] = topic, _fields(data)[b"type"].decode()
            self.topics[topic] = self._connections[fields[b"conn"]][1]
        elif kind == OP_MESSAGE:
            topic, name = self._connections[fields[b"conn"]]
            if wanted(topic):
                yield Message(topic, name, data)
