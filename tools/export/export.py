"""ballast-export LOG [--csv DIR] [--mcap FILE]: Converts an event log to CSV, one table per channel, or to MCAP."""

import argparse
import json
import re
import sys
from pathlib import Path

from command import run_program, show_progress
from event_log import LogError, scan
from mcap import MAGIC, McapWriter
from output_files import Kind, OutputError, OutputFiles, check_place
from text import MessageType, types_by_fingerprint

# Messages are converted in blocks of this size, so that memory does not grow with the log.
BLOCK = 20000
LATEST_US = (2**64 - 1) // 1000  # MCAP counts ns in 64 bits
_TABLE = Kind("CSV table of ballast export", b"timestamp_us,")
_MCAP = Kind("MCAP file", MAGIC)


class Log:
    """Reads the messages of a log in blocks. A message's type is found by its fingerprint."""

    def __init__(self, path):
        self.path = path
        self.damage = None
        self.unknown = {}  # number of events per channel whose type this build does not know
        self._classes = types_by_fingerprint()
        self._types = {}  # (fingerprint, MessageType) per channel

    def read(self, take_block):
        """Calls take_block(events, payloads) for each block.

        `events` are (timestamp, channel) in the log's order; `payloads` are the messages of each channel.
        """
        events, payloads, blocks = [], {}, 0

        def take(timestamp, channel, payload):
            nonlocal blocks
            channel = channel.decode(errors="backslashreplace")
            if payload[:8] not in self._classes:
                self.unknown[channel] = self.unknown.get(channel, 0) + 1
                return
            known = self._types.get(channel)
            if known is None:
                self._types[channel] = (payload[:8], MessageType(self._classes[payload[:8]]))
            elif known[0] != payload[:8]:
                raise LogError(f"{self.path}: {channel}: messages of two types")
            events.append((timestamp, channel))
            payloads.setdefault(channel, []).append(payload)
            if len(events) == BLOCK:
                take_block(events, payloads)
                events.clear()
                payloads.clear()
                blocks += 1
                show_progress(f"exported {blocks * BLOCK:,} messages")

        self.damage = scan(self.path, take)
        show_progress("")
        if events:
            take_block(events, payloads)
        if not self._types:
            raise LogError(f"{self.path}: no message of a type of this build"
                           f" ({sum(self.unknown.values())} others)")

    def type_of(self, channel):
        return self._types[channel][1]


def write_csv(log, folder):
    """Writes CHANNEL.csv for every channel. `timestamp_us` is the log's; the other columns are the message's fields."""
    if not folder.is_dir():
        try:
            folder.mkdir(parents=True)
        except FileExistsError as error:
            raise OutputError(f"{folder}: exists and is not a folder; it stays as it is") from error
    files, names = {}, set()

    def take_block(events, payloads):
        timestamps = {channel: [] for channel in payloads}
        for timestamp, channel in events:
            timestamps[channel].append(timestamp)
        for channel, messages in payloads.items():
            message_type = log.type_of(channel)
            if channel not in files:
                name = re.sub(r"[^\w.-]", "_", channel, flags=re.ASCII) + ".csv"
                if name in names:
                    raise LogError(f"{log.path}: {channel}: another channel also makes {name}")
                names.add(name)
                files[channel] = outputs.open(folder / name, _TABLE, encoding="ascii")
                files[channel].write(",".join(["timestamp_us", *message_type.columns]) + "\n")
            rows = message_type.numbers(messages, f"{log.path}: {channel}")
            files[channel].writelines(f"{timestamp}," + ",".join(row) + "\n"
                                      for timestamp, row in zip(timestamps[channel], rows))

    with OutputFiles(folder, [log.path]) as outputs:
        log.read(take_block)
    return len(files)


def shaped(shape, number, array, record):
    """Builds a field of this shape. The first dimension becomes an array, further ones objects.

    Foxglove refuses a channel that has an array of arrays.
    """
    if not shape:
        return number
    return array(shape[0], shaped_entry(shape[1:], number, record))


def shaped_entry(shape, number, record):
    if not shape:
        return number
    keys = "xyz" if shape[0] == 3 else [f"e{i}" for i in range(shape[0])]
    return record({key: shaped_entry(shape[1:], number, record) for key in keys})


def json_schema(message_type):
    """The JSON Schema of a message, limited to what Foxglove reads."""

    def array(_, items):
        return {"type": "array", "items": items}

    def record(properties):
        return {"type": "object", "properties": properties}

    fields = {}
    for field in message_type.fields:
        layout = message_type.layout[field]
        number = {"type": "number" if layout.base.kind == "f" else "integer"}
        fields[field] = shaped(layout.shape, number, array, record)
    return json.dumps({"title": message_type.name, **record(fields)})


def json_pattern(message_type):
    """The format string that makes a message's JSON from its numbers."""

    def array(size, item):
        return "[" + ",".join([item] * size) + "]"

    def record(entries):
        return "{" + ",".join(f'"{key}":{entry}' for key, entry in entries.items()) + "}"

    return record({field: shaped(message_type.layout[field].shape, "%s", array, record)
                   for field in message_type.fields})


def write_mcap(log, path):
    """Writes all channels into one MCAP file.

    JSON has no infinity; it is written as 1e999, which parsers of doubles read as infinity. NaN is written as null.
    """
    check_place(path, _MCAP, [log.path])
    path.parent.mkdir(parents=True, exist_ok=True)
    channels = {}
    with OutputFiles(path, [log.path]) as outputs:
        writer = McapWriter(outputs.open(path, _MCAP), "ballast")

        def take_block(events, payloads):
            texts = {}
            for channel, messages in payloads.items():
                message_type = log.type_of(channel)
                if channel not in channels:
                    channels[channel] = (writer.add_channel(channel, message_type.name, json_schema(message_type)),
                                         json_pattern(message_type))
                rows = message_type.numbers(messages, f"{log.path}: {channel}", infinity="1e999", nan="null")
                texts[channel] = iter(rows)
            for timestamp, channel in events:
                number, pattern = channels[channel]
                if timestamp > LATEST_US:
                    raise LogError(f"{log.path}: {channel}: an event has the timestamp {timestamp} us; allowed in "
                                   f"MCAP: at most {LATEST_US}")
                # MCAP has no time before 0, so the countdown is at 0. Its messages keep their tick and utime.
                writer.add_message(number, max(timestamp, 0) * 1000, (pattern % next(texts[channel])).encode())

        log.read(take_block)
        writer.finish()
    return len(channels)


def main():
    parser = argparse.ArgumentParser(prog="ballast export", description=__doc__.split(": ", 1)[1])
    parser.add_argument("log", type=Path, help="an LCM event log, or the folder of a run")
    parser.add_argument("--csv", type=Path, metavar="DIR", help="write one CSV file per channel into this folder")
    parser.add_argument("--mcap", type=Path, metavar="FILE", help="write an MCAP file, which Foxglove opens")
    arguments = parser.parse_args()

    def body():
        path = arguments.log / "run.lcmlog" if arguments.log.is_dir() else arguments.log
        for write, target in ((write_csv, arguments.csv), (write_mcap, arguments.mcap)):
            if target is None:
                continue
            log = Log(path)
            channels = write(log, target)
            if log.damage:
                print(f"ballast: {path}: {log.damage}; exported what comes before", file=sys.stderr)
            for channel, count in sorted(log.unknown.items()):
                print(f"ballast: {path}: {channel}: left out {count} messages of a type that this build does not know",
                      file=sys.stderr)
            print(f"{channels} channels in {target}")

    return run_program("ballast", body, LogError, OutputError)


if __name__ == "__main__":
    sys.exit(main())
