"""Writes MCAP files (https://mcap.dev/spec, format version 0) with what Foxglove needs to seek in a log.

Messages go into uncompressed chunks with message indexes; the summary repeats schemas and channels and points at the
chunks. All integers are little-endian; a record is opcode, uint64 length, content.
"""

import struct
import zlib

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, SUMMARY_OFFSET, DATA_END = 0x0B, 0x0E, 0x0F
CHUNK_BYTES = 1 << 20


def _record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def _string(text):
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _map(pairs, key, value):
    data = b"".join(struct.pack("<" + key + value, *pair) for pair in pairs)
    return struct.pack("<I", len(data)) + data


class McapWriter:
    """Writes to `file`, which is open for binary writing. The file is valid after finish()."""

    def __init__(self, file, library):
        self._file = file
        self._offset = 0
        self._crc = 0
        self._definitions = {SCHEMA: [], CHANNEL: []}  # records, for the summary
        self._counts = {}  # number of messages per channel
        self._times = []  # earliest and latest
        self._chunk_indexes = []
        self._start_chunk()
        self._write(MAGIC + _record(HEADER, _string("") + _string(library)))

    def _write(self, data):
        self._file.write(data)
        self._offset += len(data)
        self._crc = zlib.crc32(data, self._crc)

    def _start_chunk(self):
        self._chunk = bytearray()
        self._index = {}  # [(time, offset in the chunk)] per channel

    def add_channel(self, topic, schema_name, schema):
        """Adds a channel of JSON messages with its own schema. Returns its number."""
        number = len(self._definitions[CHANNEL]) + 1
        definitions = {
            SCHEMA: struct.pack("<H", number) + _string(schema_name) + _string("jsonschema") + _string(schema),
            CHANNEL: struct.pack("<HH", number, number) + _string(topic) + _string("json") + _map([], "I", "I"),
        }
        for opcode, content in definitions.items():
            record = _record(opcode, content)
            self._definitions[opcode].append(record)
            self._chunk += record
        self._counts[number] = 0
        return number

    def add_message(self, channel, time_ns, data):
        self._index.setdefault(channel, []).append((time_ns, len(self._chunk)))
        content = struct.pack("<HIQQ", channel, self._counts[channel] & 0xFFFFFFFF, time_ns, time_ns) + data
        self._chunk += _record(MESSAGE, content)
        self._counts[channel] += 1
        if len(self._chunk) >= CHUNK_BYTES:
            self._end_chunk()

    def _end_chunk(self):
        times = [time for entries in self._index.values() for time, _ in entries]
        if not times:
            return
        first, last = min(times), max(times)
        self._times = [min([first, *self._times]), max([last, *self._times])]
        size = len(self._chunk)
        start = self._offset
        self._write(_record(CHUNK, struct.pack("<QQQI", first, last, size, zlib.crc32(self._chunk)) + _string("") +
                            struct.pack("<Q", size) + bytes(self._chunk)))
        length = self._offset - start
        indexes = []
        for channel, entries in sorted(self._index.items()):
            indexes.append((channel, self._offset))
            self._write(_record(MESSAGE_INDEX, struct.pack("<H", channel) + _map(sorted(entries), "Q", "Q")))
        self._chunk_indexes.append(_record(
            CHUNK_INDEX,
            struct.pack("<QQQQ", first, last, start, length) + _map(indexes, "H", "Q") +
            struct.pack("<Q", self._offset - start - length) + _string("") + struct.pack("<QQ", size, size)))
        self._start_chunk()

    def finish(self):
        self._end_chunk()
        self._write(_record(DATA_END, struct.pack("<I", self._crc)))
        first, last = self._times or (0, 0)
        statistics = struct.pack("<QHIIIIQQ", sum(self._counts.values()), len(self._counts), len(self._counts), 0, 0,
                                 len(self._chunk_indexes), first, last) + _map(self._counts.items(), "H", "Q")
        groups = {**self._definitions, STATISTICS: [_record(STATISTICS, statistics)], CHUNK_INDEX: self._chunk_indexes}
        summary_start = self._offset
        summary, offsets = b"", b""
        for opcode, records in groups.items():
            if not records:
                continue
            group = b"".join(records)
            offsets += _record(SUMMARY_OFFSET, struct.pack("<BQQ", opcode, summary_start + len(summary), len(group)))
            summary += group
        footer = struct.pack("<BQQQ", FOOTER, 20, summary_start, summary_start + len(summary))
        checked = summary + offsets + footer
        self._write(checked + struct.pack("<I", zlib.crc32(checked)) + MAGIC)
