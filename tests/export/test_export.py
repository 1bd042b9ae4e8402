"""`ballast export`: what comes out is what went in, by lcm-gen's own decoders; and LCM's own logger and player."""

import csv
import json
import math
import os
import random
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
from collections import Counter
from pathlib import Path

import ballast
import strict_mcap

BALLAST = os.environ["BALLAST"]
URL = f"udpm://239.255.76.67:{12000 + os.getpid() % 8000}?ttl=0"
CLASSES = {name: value for name, value in vars(ballast).items() if hasattr(value, "_get_packed_fingerprint")}


def event(number, timestamp, channel, payload):
    """As lcm-logger writes it."""
    return struct.pack(">Iqqii", 0xEDA1DA01, number, timestamp, len(channel), len(payload)) + channel.encode() + payload


def events(path):
    """(timestamp, channel, payload) of a log."""
    data, at, out = Path(path).read_bytes(), 0, []
    while at < len(data):
        sync, _, timestamp, channel, payload = struct.unpack_from(">Iqqii", data, at)
        assert sync == 0xEDA1DA01
        at += 28
        out.append((timestamp, data[at:at + channel].decode(), data[at + channel:at + channel + payload]))
        at += channel + payload
    return out


def flat(name, value):
    if not isinstance(value, (list, tuple)):
        return {name: value}
    out = {}
    for i, entry in enumerate(value):
        out.update(flat(f"{name}[{i}]", entry))
    return out


def decoded(payload):
    """By lcm-gen's decoder: every number by its name."""
    message_class = next(c for c in CLASSES.values() if c._get_packed_fingerprint() == payload[:8])
    message = message_class.decode(payload)
    out = {}
    for field in message_class.__slots__:
        out.update(flat(field, getattr(message, field)))
    return out


def without_number(channel, payload):
    """As a log has it: on a bus messages carry the number of their run, in logs 0."""
    message_class = next(c for c in CLASSES.values() if c._get_packed_fingerprint() == payload[:8])
    message = message_class.decode(payload)
    message.run_id = 0
    return channel, message.encode()


def flat_json(name, value):
    """The same names, from a message's JSON."""
    if isinstance(value, list):
        pairs = enumerate(value)
    elif isinstance(value, dict):
        pairs = enumerate(value.values())
    else:
        return {name: value}
    out = {}
    for i, entry in pairs:
        out.update(flat_json(f"{name}[{i}]", entry))
    return out


def random_message(message_class, draw):
    """Every double that is one, infinities and NaN included; every integer of its field."""

    def fill(value):
        if isinstance(value, (list, tuple)):
            return [fill(entry) for entry in value]
        if isinstance(value, float):
            return draw.choice([math.inf, -math.inf, math.nan, 0.0, -0.0, 5e-324, 1.7976931348623157e308,
                                draw.uniform(-1, 1), draw.uniform(-1, 1) * 10.0 ** draw.randint(-300, 300)])
        return draw.randint(-128, 127)

    message = message_class()
    for field in message_class.__slots__:
        setattr(message, field, fill(getattr(message, field)))
    return message


class ExportTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def ballast(self, *arguments, status=0):
        done = subprocess.run([BALLAST, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True,
                              timeout=120)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done

    def random_log(self, per_type=5):
        seed = random.randrange(2**32)
        draw = random.Random(seed)
        sent = []
        for i in range(per_type):
            for name, message_class in sorted(CLASSES.items()):
                sent.append((1000 * i - 2000, f"CHANNEL_{name}", random_message(message_class, draw).encode()))
        (self.folder / "log").write_bytes(b"".join(event(i, *e) for i, e in enumerate(sent)))
        return sent, f"seed {seed}"

    def assert_same(self, expected, seen, text):
        if isinstance(expected, float) and math.isnan(expected):
            self.assertTrue(seen is None or math.isnan(seen), text)
        else:
            self.assertEqual(struct.pack(">d", expected) if isinstance(expected, float) else expected,
                             struct.pack(">d", seen) if isinstance(expected, float) else seen, text)

    def test_csv_has_every_number_of_every_type_exactly(self):
        sent, seed = self.random_log()
        self.ballast("export", "log", "--csv", "tables")
        for channel in {e[1] for e in sent}:
            with open(self.folder / "tables" / f"{channel}.csv", newline="", encoding="ascii") as file:
                rows = list(csv.DictReader(file))
            wanted = [(timestamp, decoded(payload)) for timestamp, name, payload in sent if name == channel]
            self.assertEqual(len(rows), len(wanted))
            for row, (timestamp, numbers) in zip(rows, wanted):
                self.assertEqual(int(row.pop("timestamp_us")), timestamp)
                self.assertEqual(list(row), list(numbers), "columns in the order of the fields")
                for name, value in numbers.items():
                    self.assert_same(value, type(value)(row[name]), f"{channel} {name} {seed}")

    def test_mcap_has_every_number_of_every_type_exactly(self):
        sent, seed = self.random_log()
        self.ballast("export", "log", "--mcap", "log.mcap")
        file = strict_mcap.McapFile((self.folder / "log.mcap").read_bytes())
        self.assertEqual(len(file.messages), len(sent))
        for (timestamp, channel, payload), (topic, time_ns, value) in zip(sent, file.messages):
            self.assertEqual((topic, time_ns), (channel, max(timestamp, 0) * 1000))
            numbers, seen = decoded(payload), {}
            for field, entry in value.items():
                seen.update(flat_json(field, entry))
            self.assertEqual(list(seen), list(numbers))
            for name, number in numbers.items():
                self.assert_same(number, seen[name], f"{channel} {name} {seed}")

    def test_schemas_describe_the_messages_in_what_foxglove_reads(self):
        # Foxglove's parser of JSON Schema: an object of numbers, objects, and arrays of those; no arrays of arrays.
        def matches(schema, value):
            if schema["type"] == "object":
                self.assertEqual(set(schema["properties"]), set(value))
                for key, entry in value.items():
                    matches(schema["properties"][key], entry)
            elif schema["type"] == "array":
                self.assertIn(schema["items"]["type"], ("number", "integer", "object"))
                for entry in value:
                    matches(schema["items"], entry)
            elif schema["type"] == "integer":
                self.assertIsInstance(value, int)
            else:
                self.assertEqual(schema["type"], "number")
                self.assertTrue(value is None or isinstance(value, float))

        self.random_log()
        self.ballast("export", "log", "--mcap", "log.mcap")
        file = strict_mcap.McapFile((self.folder / "log.mcap").read_bytes())
        for topic, _, value in file.messages:
            name, schema = file.schemas[topic]
            self.assertEqual("ballast." + topic.removeprefix("CHANNEL_"), name)
            matches(schema, value)

    def test_a_run_of_several_chunks(self):
        self.ballast("run", "paper_ball", "--set", "duration=1", "--quiet", "--out", "r")
        self.ballast("export", "r", "--mcap", "r.mcap", "--csv", "r")
        file = strict_mcap.McapFile((self.folder / "r.mcap").read_bytes())
        log = events(self.folder / "r/run.lcmlog")
        # Besides the log's own there are the topics of frames and scenes, for which test_foxglove.py is.
        topics = [topic for topic, *_ in file.messages if not topic.startswith("/")]
        self.assertTrue(topics == [channel for _, channel, _ in log], "the messages of the log, in its order")
        self.assertGreater((self.folder / "r.mcap").stat().st_size, 2 << 20, "more than two chunks")
        summary = json.loads((self.folder / "r/summary.json").read_text())
        with open(self.folder / "r/BALLAST_CONTACT.csv", newline="", encoding="ascii") as table:
            most = max(float(row["mu_required_max"]) for row in csv.DictReader(table))
        self.assertEqual(most, summary["mu_required"]["max"])

    def test_damage_and_strangers_are_said(self):
        contact = ballast.contact_t().encode()
        whole = event(0, 0, "A", contact) + event(1, 1, "GOSSIP", b"x" * 20)
        (self.folder / "log").write_bytes(whole + event(2, 2, "A", contact)[:-3])
        done = self.ballast("export", "log", "--csv", "t")
        self.assertIn("cut off inside an event", done.stderr)
        self.assertIn("GOSSIP: left out 1 messages of a type that this build does not know", done.stderr)
        self.assertEqual(len((self.folder / "t/A.csv").read_text().splitlines()), 2)

    def test_nonsense_is_refused_and_leaves_nothing(self):
        contact = ballast.contact_t().encode()
        for content, words in ((b"", "empty"), (b"no log at all" * 10, "not an LCM event log"),
                               (event(0, 0, "A", b"x" * 20), "no message of a type of this build"),
                               (event(0, 0, "A", contact + b"x"), "bytes, expected"),
                               (event(0, 0, "A", contact) + event(1, 1, "A", ballast.trip_t().encode()), "two types"),
                               (event(0, 0, "A/B", contact) + event(1, 1, "A:B", contact), "another channel")):
            (self.folder / "log").write_bytes(content)
            for option, target in (("--csv", "t"), ("--mcap", "t.mcap")):
                if words == "another channel" and option == "--mcap":
                    continue
                self.assertIn(words, self.ballast("export", "log", option, target, status=2).stderr)
                self.assertFalse(any(self.folder.glob("t*/*")) or (self.folder / "t.mcap").exists())
        (self.folder / "log").write_bytes(event(0, 2**62, "A", contact))
        said = self.ballast("export", "log", "--mcap", "t.mcap", status=2).stderr
        self.assertIn(f"log: A: an event has the timestamp {2**62} us; allowed", said)
        self.assertFalse((self.folder / "t.mcap").exists())
        self.assertIn("nowhere", self.ballast("export", "nowhere", "--csv", "t", status=2).stderr)
        self.assertIn("--csv DIR", self.ballast("export", "log", status=1).stderr)
        self.ballast("export", status=1)

    def test_nothing_but_an_earlier_export_is_written_over(self):
        (self.folder / "log").write_bytes(event(0, 0, "A", ballast.contact_t().encode()))
        (self.folder / "scenario.toml").write_text("[ball]\n")
        (self.folder / "t").mkdir()
        (self.folder / "t/A.csv").write_text("somebody's,table\n")
        os.symlink("log", self.folder / "link")
        kept = {path: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}
        for option, target, words in (("--mcap", "log", "log is an input of this program: it stays as it is"),
                                      ("--mcap", "link", "link is an input of this program"),
                                      ("--mcap", "scenario.toml", "exists and is no MCAP file"),
                                      ("--mcap", "/dev/null", "is a device"), ("--mcap", "t", "t is a folder"),
                                      ("--csv", "t", "t/A.csv exists and is no CSV table of ballast export"),
                                      ("--csv", "log", "log: exists and is not a folder")):
            self.assertIn(words, self.ballast("export", "log", option, target, status=2).stderr)
        self.assertEqual({path: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}, kept)
        (self.folder / "t/A.csv").unlink()
        for _ in range(2):  # onto nothing, and onto its own
            self.ballast("export", "log", "--csv", "t", "--mcap", "log.mcap")
        strict_mcap.McapFile((self.folder / "log.mcap").read_bytes())

    def test_a_full_disk_is_said_and_leaves_what_was_there(self):
        # No disk to fill here: a limit on the size of files fails the same write, with another word for it.
        (self.folder / "log").write_bytes(event(0, 0, "A", ballast.contact_t().encode()))
        self.ballast("export", "log", "--csv", "t", "--mcap", "log.mcap")
        self.random_log(per_type=200)
        kept = {path: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}
        for option, target in (("--csv", "t"), ("--mcap", "log.mcap")):
            done = subprocess.run([BALLAST, "export", "log", option, target], cwd=self.folder, capture_output=True,
                                  text=True, timeout=120, check=False,
                                  preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (9999, 9999)))
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(f"{target}: cannot be written: File too large; nothing is kept", done.stderr)
            self.assertEqual({path: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}, kept)

    def test_lcm_logplayer_plays_a_log_of_ours(self):
        """LCM's own reader takes every event. Its file provider stands in for the network, so that none can be lost."""
        self.ballast("run", "paper_ball", "--set", "duration=1", "--quiet", "--out", "r")
        subprocess.run(["lcm-logplayer", "--speed", "100", "--lcm-url", "file://played?mode=w", "r/run.lcmlog"],
                       cwd=self.folder, check=True, timeout=60, stdout=subprocess.DEVNULL)
        self.assertEqual([e[1:] for e in events(self.folder / "played")],
                         [e[1:] for e in events(self.folder / "r/run.lcmlog")])
        self.ballast("export", "played", "--mcap", "played.mcap")
        strict_mcap.McapFile((self.folder / "played.mcap").read_bytes())

    def test_lcm_logger_records_a_run_on_the_bus(self):
        """A recorded message is one of the run's own log, apart from the run's number, and in the same order.

        UDP may drop messages on a busy machine, so the test does not ask how many arrive, only for some of each channel.
        """
        run = ["run", "paper_ball", "--set", "duration=0.3"]
        self.ballast(*run, "--quiet", "--out", "r")
        own = [e[1:] for e in events(self.folder / "r/run.lcmlog")]
        for name in ("FIRST", "LAST"):
            (self.folder / name).write_bytes(event(0, 0, name, b"x"))
        logger = subprocess.Popen(["lcm-logger", "--quiet", "--lcm-url", URL, "live"], cwd=self.folder)
        try:
            self.play_until_recorded("FIRST", "live")
            self.ballast(*run, "--speed", "0.3", "--lcm", URL, "--quiet", "--out", "r2")
            self.play_until_recorded("LAST", "live")
        finally:
            logger.send_signal(signal.SIGINT)
            logger.wait()
        # LCM sends itself LCM_SELF_TEST whenever a program subscribes.
        everything = [without_number(*e[1:]) for e in events(self.folder / "live")
                      if e[1] not in ("FIRST", "LAST", "LCM_SELF_TEST")]
        # The scenario is told on the bus only.
        heard = [message for message in everything if message[0] != "BALLAST_SCENARIO"]
        self.assertLess(len(heard), len(everything))
        self.ballast("export", "live", "--mcap", "live.mcap")
        strict_mcap.McapFile((self.folder / "live.mcap").read_bytes())
        rest = iter(own)
        self.assertTrue(all(message in rest for message in heard), "a message is not the run's, or out of order")
        periodic = {channel for channel, count in Counter(channel for channel, _ in own).items() if count > 100}
        self.assertEqual(len(periodic), 6)
        self.assertLessEqual(periodic, {channel for channel, _ in heard})

    def play_until_recorded(self, name, log):
        """Plays the log `name`, one event on the channel `name`, until lcm-logger has written that event into `log`."""
        deadline = time.monotonic() + 60
        while not (self.folder / log).exists() or name.encode() not in (self.folder / log).read_bytes():
            self.assertLess(time.monotonic(), deadline, f"lcm-logger has not recorded {name}")
            subprocess.run(["lcm-logplayer", "--lcm-url", URL, name], cwd=self.folder, check=True, timeout=60,
                           stdout=subprocess.DEVNULL)
            time.sleep(0.1)


if __name__ == "__main__":
    sys.exit(unittest.main())
