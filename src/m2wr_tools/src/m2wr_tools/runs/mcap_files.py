# SPDX-License-Identifier: BSD-3-Clause
"""Bags as MCAP files and back: the same serialised messages, no message is decoded.

The format is described on mcap.dev/spec; ``profile ros1`` of its registry says where type, MD5 sum, caller and latching
of a connection are.
"""
from __future__ import annotations

import contextlib
import io
import os
import struct
from typing import Any, BinaryIO, Dict, Iterator, NamedTuple, Set, Tuple

import genpy
import lz4.frame
import mcap.exceptions
import rosbag
import zstandard
from mcap.records import Channel, Chunk, Footer, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Reader as BagReader
from rosbags.rosbag1 import ReaderError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from m2wr_view.errors import ViewError

LARGEST = 1 << 30           # bytes of a record or chunk that is read
MOST = 65_535               # channels, and types, of a file; MCAP numbers them with 16 bits
_PART = ".part"             # end of the name of a file that is not complete
_SECOND = 10**9           # ns
_ENCODING, _SCHEMA = "ros1", "ros1msg"


class Copied(NamedTuple):
    """What was copied."""

    messages: int
    topics: int


@contextlib.contextmanager
def _complete(path: str) -> Iterator[str]:
    """Yield the name of a new file that gets its final name when it is complete, or is removed."""
    if os.path.exists(path):
        raise ViewError("%s exists; expected the name of a new file" % path)
    part = path + _PART
    with contextlib.suppress(FileNotFoundError):
        os.remove(part)
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise ViewError("%s: %s" % (error.filename or path, error.strerror or error)) from error
    finally:
        with contextlib.suppress(OSError):
            os.remove(part)


# ---- to MCAP ---------------------------------------------------------------------------------------------------

class _Channels:
    """The channels of an MCAP file that is written, one for each connection of a bag."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self._schemas: Dict[Tuple[str, str], int] = {}
        self._channels: Dict[int, int] = {}
        self._numbers: Dict[int, int] = {}

    def write(self, connection: Any, time: int, data: bytes) -> None:
        """Write a message."""
        channel = self._channels.get(connection.id)
        if channel is None:
            channel = self._channels[connection.id] = self._register(connection)
        number = self._numbers[channel] = self._numbers.get(channel, 0) + 1
        self._writer.add_message(channel, time, data, time, number)

    def _register(self, connection: Any) -> int:
        kind = connection.msgtype.replace("/msg/", "/")
        schema = self._schemas.get((kind, connection.msgdef))
        if schema is None:
            schema = self._writer.register_schema(kind, _SCHEMA, connection.msgdef.encode("utf-8"))
            self._schemas[kind, connection.msgdef] = schema
        fields = {"md5sum": connection.digest}
        if connection.ext.callerid is not None:
            fields["callerid"] = connection.ext.callerid
        if connection.ext.latching is not None:
            fields["latching"] = str(connection.ext.latching)
        number: int = self._writer.register_channel(connection.topic, _ENCODING, schema, fields)
        return number


def bag_to_mcap(source: str, target: str) -> Copied:
    """Write an MCAP file with the messages of a bag.

    Parameters
    ----------
    source : str
        Path of the bag.
    target : str
        Path of a new file.

    Returns
    -------
    Copied

    Raises
    ------
    ViewError
        If the bag cannot be read or the file cannot be written.
    """
    messages = 0
    try:
        with _complete(target) as part, BagReader(source) as bag, open(part, "wb") as stream:
            if len(bag.connections) > MOST:
                raise ViewError("bag %s: %d connections; expected at most %d" % (source, len(bag.connections), MOST))
            writer = McapWriter(stream, compression=CompressionType.LZ4)
            writer.start("ros1", "m2wr_tools")
            channels = _Channels(writer)
            for connection, time, data in bag.messages():
                channels.write(connection, time, data)
                messages += 1
            writer.finish()
            return Copied(messages, len({connection.topic for connection in bag.connections}))
    except ViewError:
        raise
    except ReaderError as error:
        raise ViewError("bag %s: %s; expected a bag of format 2.0 that is whole (try `rosbag reindex`)" % (
            source, error)) from error
    except Exception as error:      # damaged bytes cause errors of any kind
        raise ViewError("bag %s: it cannot be read (%s: %s); expected a bag of format 2.0 that is whole" % (
            source, type(error).__name__, error)) from error


# ---- from MCAP -------------------------------------------------------------------------------------------------

def _decompressed(chunk: Chunk) -> bytes:
    """Return the records of a chunk; ViewError if they are larger than they should be."""
    if chunk.uncompressed_size > LARGEST:
        raise ViewError("a chunk of %d bytes; expected at most %d" % (chunk.uncompressed_size, LARGEST))
    size = chunk.uncompressed_size
    if chunk.compression == "":
        data = chunk.data
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif chunk.compression == "zstd":
        data = zstandard.ZstdDecompressor().stream_reader(io.BytesIO(chunk.data)).read(size + 1)
    else:
        raise ViewError("compression %r; expected lz4, zstd or none" % chunk.compression[:20])
    if len(data) != size:
        raise ViewError("a chunk has other bytes than the %d it states" % size)
    return data


def _records(stream: BinaryIO) -> Iterator[Any]:
    """Yield schemas, channels and messages of a file in their order; ViewError if its end is missing."""
    complete = False
    for record in StreamReader(stream, emit_chunks=True, record_size_limit=LARGEST).records:
        if isinstance(record, Chunk):
            content = _decompressed(record)
            inner = StreamReader(io.BytesIO(content + _END), skip_magic=True, record_size_limit=LARGEST)
            yield from (one for one in inner.records if not isinstance(one, Footer))
        elif isinstance(record, Footer):
            complete = True
        else:
            yield record
    if not complete:
        raise ViewError("the end is missing")


#: A footer and the magic bytes, which a reader of records expects at the end (mcap.dev/spec).
_END = struct.pack("<BQQQI", 2, 20, 0, 0, 0) + b"\x89MCAP0\r\n"


class _Connection(NamedTuple):
    """A topic and the header of a connection."""

    topic: str
    header: Dict[str, str]


class _Connections:
    """The connections of a bag that is written, one for each channel of an MCAP file."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self._schemas: Dict[int, Schema] = {}
        self._channels: Dict[int, Channel] = {}
        self._made: Dict[int, _Connection] = {}
        self.topics: Set[str] = set()

    def take(self, record: Any) -> bool:
        """Take a record; return whether it was a message, which is written."""
        if isinstance(record, Schema):
            self._schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            self._channels.setdefault(record.id, record)
        elif isinstance(record, Message):
            connection = self._made.get(record.channel_id)
            if connection is None:
                connection = self._made[record.channel_id] = self._connect(record.channel_id)
            self.topics.add(connection.topic)
            header = connection.header
            self._writer.write(connection.topic, (header["type"], record.data, header["md5sum"], None, None),
                               genpy.Time(*divmod(record.log_time, _SECOND)), True, header)
            return True
        return False

    def _connect(self, number: int) -> _Connection:
        channel = self._channels.get(number)
        schema = self._schemas.get(channel.schema_id) if channel is not None else None
        if channel is None or schema is None:
            raise ViewError("a message of channel %d, which is not described before" % number)
        if channel.message_encoding != _ENCODING or schema.encoding != _SCHEMA:
            raise ViewError("topic %s is encoded as %r with types in %r; expected ros1 with ros1msg" % (
                channel.topic, channel.message_encoding, schema.encoding))
        text, digest = schema.data.decode("utf-8"), channel.metadata.get("md5sum", "")
        if not digest:
            types = get_typestore(Stores.EMPTY)
            types.register(get_types_from_msg(text, _long(schema.name)))
            digest = types.generate_msgdef(_long(schema.name))[1]
        header = {"topic": channel.topic, "type": _long(schema.name).replace("/msg/", "/"), "md5sum": digest,
                  "message_definition": text}
        header.update((name, channel.metadata[name]) for name in ("callerid", "latching") if name in channel.metadata)
        return _Connection(channel.topic, header)


def _long(name: str) -> str:
    """Return a type as ``package/msg/Name``."""
    package, _, rest = name.partition("/")
    return "%s/msg/%s" % (package, rest.rpartition("/")[2])


def mcap_to_bag(source: str, target: str) -> Copied:
    """Write a bag with the messages of an MCAP file of ROS 1.

    Parameters
    ----------
    source : str
        Path of the MCAP file.
    target : str
        Path of a new file.

    Returns
    -------
    Copied

    Raises
    ------
    ViewError
        If the file is not whole, is no recording of ROS 1, or the bag cannot be written.
    """
    messages = 0
    try:
        with _complete(target) as part, open(source, "rb") as stream:
            with rosbag.Bag(part, "w", compression="lz4") as writer:
                connections = _Connections(writer)
                for record in _records(stream):
                    messages += connections.take(record)
            return Copied(messages, len(connections.topics))
    except ViewError as error:
        raise error if source in str(error) or target in str(error) else ViewError("%s: %s" % (source, error)) from None
    except (mcap.exceptions.McapError, mcap.exceptions.EndOfFile) as error:
        raise ViewError("%s: it cannot be read (%s); expected an MCAP file that is whole" % (
            source, str(error) or type(error).__name__)) from error
    except Exception as error:      # damaged bytes cause errors of any kind
        raise ViewError("%s: it cannot be read (%s: %s); expected an MCAP file that is whole" % (
            source, type(error).__name__, error)) from error
