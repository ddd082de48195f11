# SPDX-License-Identifier: BSD-3-Clause
"""Makes readers of a bag return each topic in the order in which its messages were recorded.

rosbag's readers sort by recorded time.  With simulated time many messages have the same time. Then the messages of
several publishers on one topic are sorted by the order of connections, which differs between runs.  Here equal times in
a bag's index are increased, by a nanosecond each, so that they give the order.

The format is described on wiki.ros.org/Bags/Format/2.0.
"""
from __future__ import annotations

import os
import struct
from typing import BinaryIO, Dict, Iterator, List, NamedTuple, Tuple

_MAGIC = b"#ROSBAG V2.0\n"
_INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 4, 5, 6, 7       # kinds of records
_COUNT, _TIME, _ENTRY = struct.Struct("<I"), struct.Struct("<II"), struct.Struct("<III")


class _Record(NamedTuple):
    """A record of a bag: its header, and positions and size in the file [bytes]."""

    fields: Dict[bytes, bytes]
    header_at: int
    data_at: int
    size: int
    end: int


def settle_times(path: str) -> int:
    """Make the times in a bag's index strictly increasing on each topic, in the order of recording.

    Times that go back, as after a reset of the simulation, stay. Only the index is changed, not the messages: in
    place, so that the bag is valid at any moment.

    Parameters
    ----------
    path : str
        Of a bag that was closed.

    Returns
    -------
    int
        Number of changed times.

    Raises
    ------
    OSError
        If it cannot be read or written.
    ValueError
        If it is no bag of version 2.0 with an index.
    """
    with open(path, "r+b") as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise ValueError("%s is no bag of version 2.0" % path)
        try:
            return _settle(stream)
        except (struct.error, KeyError, IndexError) as error:
            raise ValueError("%s has no index that can be read: %s: %s"
                             % (path, type(error).__name__, error)) from error


def _settle(stream: BinaryIO) -> int:
    position = struct.unpack("<Q", _record(stream, len(_MAGIC)).fields[b"index_pos"])[0]
    if not 0 < position <= stream.seek(0, os.SEEK_END):
        raise ValueError("%s has no index; expected one that was closed" % stream.name)
    topics: Dict[int, bytes] = {}
    chunks: List[Tuple[int, _Record]] = []
    for record in _records(stream, position):
        kind = record.fields[b"op"][0]
        if kind == _CONNECTION:
            topics[_COUNT.unpack(record.fields[b"conn"])[0]] = record.fields[b"topic"]
        elif kind == _CHUNK_INFO:
            chunks.append((struct.unpack("<Q", record.fields[b"chunk_pos"])[0], record))
    changed = 0
    last: Dict[bytes, Tuple[int, int]] = {}     # topic -> its last time before and after the change [ns]
    for at, info in sorted(chunks, key=lambda chunk: chunk[0]):
        count, newest = _settle_chunk(stream, at, topics, last)
        changed += count
        end = _TIME.unpack(info.fields[b"end_time"])
        if newest > end[0] * 10 ** 9 + end[1]:
            _write_time(stream, _value_at(stream, info, b"end_time"), newest)
    return changed


def _settle_chunk(stream: BinaryIO, at: int, topics: Dict[int, bytes],
                  last: Dict[bytes, Tuple[int, int]]) -> Tuple[int, int]:
    """Correct one chunk; return the number of changed times, and the newest time [ns]."""
    entries, newest, changed = [], 0, 0
    for record in _records(stream, _record(stream, at).end):
        if record.fields[b"op"][0] != _INDEX:
            break
        topic = topics[_COUNT.unpack(record.fields[b"conn"])[0]]
        stream.seek(record.data_at)
        for number, (secs, nsecs, offset) in enumerate(_ENTRY.iter_unpack(stream.read(record.size))):
            entries.append((offset, record.data_at + number * _ENTRY.size, topic, secs * 10 ** 9 + nsecs))
    for _, place, topic, time in sorted(entries):
        before, settled = last.get(topic, (-1, -1))
        now = time if time < before else max(time, settled + 1)
        last[topic], newest = (time, now), max(newest, now)
        if now != time:
            _write_time(stream, place, now)
            changed += 1
    return changed, newest


def _records(stream: BinaryIO, position: int) -> Iterator[_Record]:
    """Yield the records from a position on."""
    while True:
        stream.seek(position)
        if not stream.read(1):
            return
        record = _record(stream, position)
        yield record
        position = record.end


def _record(stream: BinaryIO, position: int) -> _Record:
    """Read the header of the record at a position."""
    stream.seek(position)
    header = stream.read(_COUNT.unpack(stream.read(4))[0])
    size, at = _COUNT.unpack(stream.read(4))[0], 0
    fields: Dict[bytes, bytes] = {}
    while at < len(header):
        length = _COUNT.unpack_from(header, at)[0]
        name, _, value = header[at + 4:at + 4 + length].partition(b"=")
        fields[name] = value
        at += 4 + length
    data_at = position + 8 + len(header)
    return _Record(fields, position + 4, data_at, size, data_at + size)


def _value_at(stream: BinaryIO, record: _Record, name: bytes) -> int:
    """Return where in the file the value of a field of a record's header begins."""
    stream.seek(record.header_at)
    header, at = stream.read(record.data_at - 4 - record.header_at), 0
    while not header.startswith(name + b"=", at + 4):
        at += 4 + _COUNT.unpack_from(header, at)[0]
    return record.header_at + at + 4 + len(name) + 1


def _write_time(stream: BinaryIO, position: int, time_ns: int) -> None:
    stream.seek(position)
    stream.write(_TIME.pack(*divmod(time_ns, 10 ** 9)))
