"""ballast-export LOG [--csv DIR] [--mcap FILE]: Converts an event log to CSV, one table per channel, or to MCAP."""

import argparse
import json
import re
import sys
from pathlib import Path

from command import run_program, show_progress
from drawn_robot import NoRobot, read_robot
from event_log import LogError, scan
from foxglove_scene import RunScene
from foxglove_schemas import SCHEMAS
from json_messages import json_pattern, json_schema
from mcap import MAGIC, McapWriter
from output_files import Kind, OutputError, OutputFiles, check_place
from run_samples import RunSamples
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
    return f"{len(files)} channels"


class _Drawing:
    """Draws the run for Foxglove's 3-D panel. Without a description of its robot it draws nothing.

    `trouble` is the reason why something is left out, else None.
    """

    def __init__(self, folder):
        self.trouble = None
        self._samples, self._scene = RunSamples(), None
        try:
            self._scene = RunScene(read_robot(folder))
        except NoRobot as error:
            self._why_none = str(error)

    def take(self, time_us, channel, payload):
        """[(topic, schema name, message)] that follow from this message."""
        taken = self._samples.take(time_us, channel, payload)
        if self._samples.skipped:
            self.trouble = f"left out {self._samples.skipped} samples with numbers that cannot be drawn"
        if taken is None:
            return []
        sample, is_last = taken
        if self._scene is not None and not self._scene.matches(sample):
            self._scene, self._why_none = None, f"robot.json beside the log is of another robot: the log has " \
                                                f"{len(sample.masses_B)} masses"
        if self._scene is None:
            self.trouble = f"nothing drawn: {self._why_none}"
            return []
        return self._scene.messages(sample, is_last)


class _McapChannels:
    """The channels of an MCAP file: those of the log, and what is drawn of it."""

    def __init__(self, log, file):
        self._log, self._writer = log, McapWriter(file, "ballast")
        self._of_log, self._drawn = {}, {}
        self.drawing = _Drawing(log.path.parent)

    @property
    def counts(self):
        """The numbers of channels of the log, and drawn."""
        return len(self._of_log), len(self._drawn)

    def take_block(self, events, payloads):
        texts = {}
        for channel, messages in payloads.items():
            message_type = self._log.type_of(channel)
            if channel not in self._of_log:
                number = self._writer.add_channel(channel, message_type.name, json_schema(message_type))
                self._of_log[channel] = number, json_pattern(message_type)
            rows = message_type.numbers(messages, f"{self._log.path}: {channel}", infinity="1e999", nan="null")
            texts[channel] = zip(rows, messages)
        for timestamp, channel in events:
            number, pattern = self._of_log[channel]
            if timestamp > LATEST_US:
                raise LogError(f"{self._log.path}: {channel}: an event has the timestamp {timestamp} us; allowed in "
                               f"MCAP: at most {LATEST_US}")
            # MCAP has no time before 0, so the countdown is at 0. Its messages keep their tick and utime.
            time_us = max(timestamp, 0)
            row, payload = next(texts[channel])
            self._writer.add_message(number, time_us * 1000, (pattern % row).encode())
            for drawn in self.drawing.take(time_us, channel, payload):
                self._draw(time_us, *drawn)

    def _draw(self, time_us, topic, schema_name, message):
        if topic not in self._drawn:
            self._drawn[topic] = self._writer.add_channel(topic, schema_name, SCHEMAS[schema_name])
        self._writer.add_message(self._drawn[topic], time_us * 1000, json.dumps(message, separators=(",", ":")).encode())

    def finish(self):
        self._writer.finish()


def write_mcap(log, path):
    """Writes all channels into one MCAP file, with frames and scenes for Foxglove's 3-D panel.

    JSON has no infinity; it is written as 1e999, which parsers of doubles read as infinity. NaN is written as null.
    """
    check_place(path, _MCAP, [log.path])
    path.parent.mkdir(parents=True, exist_ok=True)
    with OutputFiles(path, [log.path]) as outputs:
        channels = _McapChannels(log, outputs.open(path, _MCAP))
        log.read(channels.take_block)
        channels.finish()
    if channels.drawing.trouble:
        print(f"ballast: {log.path}: frames and scenes: {channels.drawing.trouble}", file=sys.stderr)
    of_log, drawn = channels.counts
    return f"{of_log} channels" + (f", and {drawn} of frames and scenes," if drawn else "")


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
            print(f"{channels} in {target}")

    return run_program("ballast", body, LogError, OutputError)


if __name__ == "__main__":
    sys.exit(main())
