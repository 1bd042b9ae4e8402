"""A reader of MCAP files that forgives nothing, after the specification (https://mcap.dev/spec), for tests.

Every record is read to its last byte, every offset, length, count, time and checksum is checked, and what the summary
says is held against what the data section has. Only what the specification allows anywhere, and ours writes, is known:
no attachments, no metadata, no compression.
"""

import json
import struct
import zlib

MAGIC = b"\x89MCAP0\r\n"


class Fields:
    """The content of a record, taken field by field; the end must be reached exactly."""

    def __init__(self, content):
        self.content, self.at = content, 0

    def take(self, code):
        values = struct.unpack_from("<" + code, self.content, self.at)
        self.at += struct.calcsize("<" + code)
        return values[0] if len(values) == 1 else values

    def data(self, length_code):
        size = self.take(length_code)
        assert self.at + size <= len(self.content), "a length beyond the record"
        self.at += size
        return self.content[self.at - size:self.at]

    def text(self):
        return self.data("I").decode("utf-8")

    def pairs(self, code):
        inner = Fields(self.data("I"))
        pairs = []
        while inner.at < len(inner.content):
            pairs.append(inner.take(code))
        return pairs

    def end(self):
        assert self.at == len(self.content), "bytes left in a record"


def records(data, start, end):
    at = start
    while at < end:
        opcode, size = struct.unpack_from("<BQ", data, at)
        assert at + 9 + size <= end, "a record beyond its section"
        yield at, opcode, data[at + 9:at + 9 + size], 9 + size
        at += 9 + size
    assert at == end


class McapFile:
    """`messages`: (topic, time in ns, JSON value) in the order of the file; `schemas`: by topic."""

    def __init__(self, data):
        assert data[:8] == MAGIC and data[-8:] == MAGIC, "magic"
        self._schema_records, self._channel_records = {}, {}
        self.schemas, self.messages, self._chunks, self._counts = {}, [], [], {}
        footer_at = len(data) - 8 - 9 - 20
        opcode, size = struct.unpack_from("<BQ", data, footer_at)
        assert (opcode, size) == (2, 20), "footer"
        summary_start, offsets_start, crc = struct.unpack_from("<QQI", data, footer_at + 9)
        assert zlib.crc32(data[summary_start:footer_at + 9 + 16]) == crc, "summary checksum"
        self._read_data(data, summary_start)
        self._read_summary(data, summary_start, offsets_start)
        self._read_offsets(data, summary_start, offsets_start, footer_at)

    def _define(self, opcode, content):
        known = {3: self._schema_records, 4: self._channel_records}[opcode]
        number = struct.unpack_from("<H", content)[0]
        assert known.setdefault(number, content) == content, "two definitions of one number"
        fields = Fields(content)
        fields.take("H")
        if opcode == 3:
            assert number != 0
            fields.text()
            assert fields.text() == "jsonschema"
            json.loads(fields.text())
        else:
            schema = fields.take("H")
            assert schema in self._schema_records, "a channel before its schema"
            topic = fields.text()
            assert fields.text() == "json"
            assert fields.pairs("I") == []
            inner = Fields(self._schema_records[schema])
            inner.take("H")
            name, _ = inner.text(), inner.text()
            self.schemas[topic] = (name, json.loads(inner.text()))
        fields.end()

    def _topic(self, number):
        fields = Fields(self._channel_records[number])
        fields.take("HH")
        return fields.text()

    def _read_data(self, data, end):
        pending = None  # message indexes the last chunk still needs
        opcodes = []
        for at, opcode, content, length in records(data, 8, end):
            opcodes.append(opcode)
            assert opcodes[0] == 1 and opcodes.count(1) == 1, "header first, and once"
            assert 15 not in opcodes[:-1], "something after data end"
            fields = Fields(content)
            if opcode == 1:
                assert fields.text() == ""
                fields.text()
            elif opcode == 6:
                assert not pending, "a chunk without all its indexes"
                pending = self._read_chunk(fields, at, length)
            elif opcode == 7:
                number = fields.take("H")
                entries = fields.pairs("QQ")
                assert entries == sorted(pending.pop(number)), "message index"
                self._chunks[-1]["indexes"].append((number, at))
                self._chunks[-1]["index_length"] += length
            else:
                assert opcode == 15, f"record {opcode} in the data section"
                assert fields.take("I") == zlib.crc32(data[:at]), "data checksum"
            fields.end()
        assert opcodes[-1] == 15 and not pending

    def _read_chunk(self, fields, at, length):
        first, last, size, crc = fields.take("QQQI")
        assert fields.text() == "", "no compression"
        chunk = fields.data("Q")
        assert len(chunk) == size and zlib.crc32(chunk) == crc, "chunk checksum"
        index, times = {}, []
        for offset, opcode, content, _ in records(chunk, 0, len(chunk)):
            if opcode != 5:
                self._define(opcode, content)
                continue
            number, sequence, log_time, publish_time = struct.unpack_from("<HIQQ", content)
            assert number in self._channel_records, "a message before its channel"
            assert sequence == self._counts.get(number, 0)
            assert log_time == publish_time
            self._counts[number] = sequence + 1
            index.setdefault(number, []).append((log_time, offset))
            times.append(log_time)
            self.messages.append((self._topic(number), log_time, json.loads(content[22:])))
        assert (first, last) == (min(times), max(times)), "chunk times"
        self._chunks.append({"head": (first, last, at, length), "size": size, "indexes": [], "index_length": 0})
        return index

    def _read_summary(self, data, start, end):
        groups, seen, chunks, statistics = [], {3: {}, 4: {}}, [], []
        for at, opcode, content, _ in records(data, start, end):
            if not groups or groups[-1][0] != opcode:
                groups.append([opcode, at, at])
            groups[-1][2] = at + 9 + len(content)
            fields = Fields(content)
            if opcode in (3, 4):
                seen[opcode][struct.unpack_from("<H", content)[0]] = content
                continue
            if opcode == 8:
                chunks.append({"head": fields.take("QQQQ"), "indexes": fields.pairs("HQ"),
                               "index_length": fields.take("Q")})
                assert fields.text() == ""
                compressed, chunks[-1]["size"] = fields.take("QQ")
                assert compressed == chunks[-1]["size"]
            else:
                assert opcode == 11, f"record {opcode} in the summary"
                statistics.append((fields.take("QHIIIIQQ"), fields.pairs("HQ")))
            fields.end()
        assert len({group[0] for group in groups}) == len(groups), "the summary is not grouped"
        assert seen == {3: self._schema_records, 4: self._channel_records}, "definitions in the summary"
        assert chunks == self._chunks, "chunk indexes"
        times = [time for _, time, _ in self.messages]
        assert statistics == [((len(times), len(seen[3]), len(seen[4]), 0, 0, len(chunks), min(times), max(times)),
                               sorted(self._counts.items()))], "statistics"
        self._groups = groups

    def _read_offsets(self, data, summary_start, start, end):
        assert summary_start < start
        offsets = []
        for _, opcode, content, _ in records(data, start, end):
            assert opcode == 14
            offsets.append(list(struct.unpack("<BQQ", content)))
        assert offsets == [[opcode, first, last - first] for opcode, first, last in self._groups], "summary offsets"
