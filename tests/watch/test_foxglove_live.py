"""`ballast watch --foxglove`: what Foxglove's own client gets of a run under way, and how the server meets strangers."""

import asyncio
import contextlib
import itertools
import json
import os
import re
import signal
import socket
import struct
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

import jsonschema
import numpy as np
import websockets
from websockets.exceptions import ConnectionClosed

import ballast
import npm_packages
from event_log import EventLog

BALLAST = os.environ["BALLAST"]
OLD, NEW = "foxglove.websocket.v1", "foxglove.sdk.v1"
PATIENCE_S = 60
_buses = itertools.count(20000 + os.getpid() % 8000 * 4)
# With 250 ticks per second a busy machine may keep the reader waiting for 0.2 s until the bus loses messages.
OTHER_RUN = ["desk_ball", "--set", "run.control_period=0.004", "--set", "duration=1.2"]
RUN = [*OTHER_RUN, "--set", "duration=1.5"]


class Lines:
    """The lines of a process's output, read as they come."""

    def __init__(self, stream):
        self.lines, self._more = [], threading.Condition()
        self._ended = False
        threading.Thread(target=self._read, args=(stream,), daemon=True).start()

    def _read(self, stream):
        for line in stream:
            with self._more:
                self.lines.append(line)
                self._more.notify_all()
        with self._more:
            self._ended = True
            self._more.notify_all()

    def first(self, wanted, start=0):
        """The first line from `start` on for which wanted(line) is true; it is waited for."""
        deadline = time.monotonic() + PATIENCE_S
        with self._more:
            for number in itertools.count(start):
                while number >= len(self.lines):
                    left = deadline - time.monotonic()
                    if self._ended or left <= 0:
                        raise AssertionError("not said: " + "".join(self.lines)[-2000:])
                    self._more.wait(left)
                if wanted(self.lines[number]):
                    return self.lines[number]
        return None

    def all(self):
        """All lines, once the process has ended."""
        with self._more:
            self._more.wait_for(lambda: self._ended, PATIENCE_S)
            return list(self.lines)


def near_the_end(line):
    """Whether a line is a message of RUN's last 0.3 s. The very last one may be lost on a busy machine."""
    entry = re.match(r'{"topic":"/scene/contact","logTime":(\d+),', line)
    return entry is not None and int(entry[1]) > 1.2 * 10**9


class Live(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        holder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(holder.cleanup)
        cls.folder = Path(holder.name)
        npm_packages.unpack(cls.folder)
        cls.schemas = json.loads(npm_packages.output_of_node(cls.folder, "print_schemas.mjs"))
        # The run of RUN as it is recorded, and the scenario to watch it by.
        cls.command(*["run", *RUN, "--quiet", "--out", cls.folder / "r"])
        cls.scenario = cls.folder / "r" / "scenario.toml"
        log = EventLog(cls.folder / "r" / "run.lcmlog", ["BALLAST_PLANT_STATE"])
        cls.state = {int(row["utime"]): row for row in log.messages("BALLAST_PLANT_STATE", ballast.plant_state_t)}

    def setUp(self):
        self.bus = f"udpm://239.255.76.67:{next(_buses) % 40000 + 20000}?ttl=0"

    @staticmethod
    def command(*arguments, status=0):
        done = subprocess.run([BALLAST, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)
        if done.returncode != status:
            raise AssertionError(f"status {done.returncode}: {done.stdout}{done.stderr}")
        return done

    def run_live(self, *arguments):
        self.command("run", *(arguments or RUN), "--speed", "1", "--lcm", self.bus, "--quiet", "--out", self.folder / "live")

    @contextlib.contextmanager
    def watch(self, *arguments, scenario=None):
        """(process, its stderr as Lines, the server's URL)."""
        with subprocess.Popen([BALLAST, "watch", "--lcm", self.bus, "--foxglove", str(scenario or self.scenario), "--port", "0",
                               *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            try:
                said = Lines(process.stderr)
                line = said.first(lambda text: "Foxglove can connect to " in text)
                yield process, said, re.search(r"ws://\S+", line)[0]
            finally:
                process.terminate()

    @contextlib.contextmanager
    def viewer(self, url, subprotocol=OLD):
        """The lines that Foxglove's client prints; it has subscribed."""
        process = npm_packages.node(self.folder, "view_live.mjs", url, subprotocol)
        with process:
            try:
                lines = Lines(process.stdout)
                lines.first(lambda line: line.startswith('{"time"'))
                yield lines
            finally:
                process.terminate()

    def judge(self, entries):
        """Messages are valid by their schemas, no later than the time told before, and the ball is where the log has it."""
        (channels,) = (entry["channels"] for entry in entries if "channels" in entry)
        names = {channel["topic"]: channel["schemaName"] for channel in channels}
        for channel in channels:
            self.assertEqual((channel["encoding"], channel["schemaEncoding"]), ("json", "jsonschema"))
            json.loads(channel["schema"])
        validators = {name: jsonschema.Draft7Validator(self.schemas[name]) for name in set(names.values())
                      if name.startswith("foxglove.")}
        self.assertEqual(set(validators), {"foxglove.FrameTransform", "foxglove.SceneUpdate"})
        clock, seen = None, []
        for entry in entries:
            clock = entry.get("time", clock)
            if "topic" not in entry:
                continue
            # The time comes first. Where the viewer was slow it is newer than a message of a topic that is sent less often.
            topic, message, log_time = entry["topic"], entry["message"], entry["logTime"]
            self.assertLessEqual(log_time, clock)
            seen.append((topic, log_time))
            if names[topic] in validators and len(seen) % 7 == 0:
                validators[names[topic]].validate(message)
            if topic == "/frames/ball":
                row = self.state[log_time // 1000]
                np.testing.assert_array_equal([message["translation"][k] for k in "xyz"], row["position_W_m"])
                np.testing.assert_array_equal([message["rotation"][k] for k in "wxyz"], row["orientation"])
        return names, seen

    def test_two_runs_and_a_viewer_who_comes_late(self):
        with self.watch("--forever") as (process, _, url):
            with self.viewer(url) as lines:
                self.run_live()
                lines.first(near_the_end)
                first_run = len(lines.lines)
                self.run_live()
                lines.first(near_the_end, first_run)
                with self.viewer(url, NEW) as late:
                    # The newest message of every channel, though nothing happens any more.
                    late.first(lambda line: '"/scene/floor"' in line)
                    late.first(lambda line: '"/scene/fixed"' in line)
                    late.first(lambda line: '"/frames/mass_2"' in line)
                process.send_signal(signal.SIGTERM)
                self.assertEqual(process.wait(PATIENCE_S), 0)
                entries = [json.loads(line) for line in lines.all()]
        names, seen = self.judge(entries)
        frames = {f"/frames/{name}" for name in ("floor", "space", "contact", "ball", "mass_0", "mass_1", "mass_2")}
        raw = {"BALLAST_CONTACT", "BALLAST_PLANT_STATE", "BALLAST_CONTROLLER_STATUS", "BALLAST_TRIP"}
        self.assertEqual(set(names), frames | raw | {"/scene/fixed", "/scene/contact", "/scene/floor"})
        self.assertEqual({topic for topic, _ in seen}, set(names))
        # Time goes back once, where the second run begins, and what does not change comes after it once more.
        times = [entry["time"] for entry in entries if "time" in entry]
        self.assertEqual(sum(b < a for a, b in zip(times, times[1:])), 1)
        self.assertEqual([topic for topic, _ in seen].count("/scene/fixed"), 2)
        balls = [clock for topic, clock in seen if topic == "/frames/ball"]
        self.assertGreater(len(balls), 20)

    def test_only_the_run_of_the_scenario_is_shown(self):
        with self.watch() as (process, said, _):
            self.run_live(*OTHER_RUN)
            self.assertEqual(process.wait(PATIENCE_S), 2)
        self.assertIn("the run on this bus is of another scenario (every --set counts); allowed: the same, or the scenario.toml",
                      "".join(said.all()))
        with self.watch("--forever", "--every", "0.1") as (_, said, url), self.viewer(url) as lines:
            self.run_live(*OTHER_RUN)
            said.first(lambda line: "of another scenario" in line)
            self.run_live()
            lines.first(near_the_end)
        _, seen = self.judge([json.loads(line) for line in lines.all()])
        self.assertEqual(sum("of another scenario" in line for line in said.all()), 1)

    def test_the_end_of_the_run_ends_the_server_and_its_viewers(self):
        with self.watch() as (process, _, url), self.viewer(url) as lines:
            self.run_live()
            self.assertEqual(process.wait(PATIENCE_S), 0)
            entries = [json.loads(line) for line in lines.all()]
        # `watch` has ended with the run's last messages, so they have been drawn.
        self.assertEqual([entry["time"] for entry in entries if "time" in entry][-1], 1500 * 10**6)

    def test_strangers(self):
        with self.watch("--forever") as (process, _, url):
            asyncio.run(asyncio.wait_for(self.be_strange(url), PATIENCE_S))
            with self.viewer(url) as lines:  # while one never reads
                deaf = self.deaf_viewer(url)
                self.run_live()
                lines.first(near_the_end)
                deaf.close()
            self.assertIsNone(process.poll())

    def deaf_viewer(self, url):
        """Subscribes to all, and never reads."""
        port = int(url.rsplit(":", 1)[1])
        deaf = socket.create_connection(("127.0.0.1", port))
        deaf.sendall(f"GET / HTTP/1.1\r\nHost: localhost:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                     f"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
                     f"Sec-WebSocket-Protocol: {NEW}\r\n\r\n".encode())
        deaf.recv(1)
        wanted = json.dumps({"op": "subscribe", "subscriptions": [{"id": i, "channelId": i} for i in range(1, 15)]}).encode()
        deaf.sendall(struct.pack(">BBH", 0x81, 0x80 | 126, len(wanted)) + bytes(4) + wanted)
        return deaf

    async def be_strange(self, url):
        async with websockets.connect(url) as viewer:
            with self.assertRaises(ConnectionClosed) as closed:
                await viewer.recv()
            self.assertEqual(closed.exception.rcvd.code, 1002)
            self.assertIn(NEW, closed.exception.rcvd.reason)
        async with websockets.connect(url, subprotocols=[NEW]) as viewer:
            info, advertised = json.loads(await viewer.recv()), json.loads(await viewer.recv())
            self.assertEqual((info["op"], info["capabilities"], advertised["op"]), ("serverInfo", ["time"], "advertise"))
            self.assertEqual(await viewer.recv(), struct.pack("<BQ", 2, 0))
            for request, words in (
                    ("{", "not a request"), ("3", "not a request"), ("[" * 60000, "not a request"), (b"\x01\x00", "only shows"),
                    ('{"op":"advertise","channels":[]}', "only shows"), ('{"op":"subscribe"}', "not a request"),
                    ('{"op":"subscribe","subscriptions":[{"id":1}]}', "not a request"),
                    ('{"op":"subscribe","subscriptions":[{"id":1,"channelId":99}]}', "no such channel: 99"),
                    ('{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}', "no such channel"),
                    ('{"op":"subscribe","subscriptions":[{"id":1,"channelId":{}}]}', "not a request"),
                    ('{"op":"subscribe","subscriptions":[{"id":1,"channelId":1},{"id":2,"channelId":1}]}', "subscribed already"),
                    ('{"op":"unsubscribe","subscriptionIds":7}', "not a request"),
                    ('{"op":"subscribe","subscriptions":[{"id":1,"channelId":2}]}', "subscribed already")):
                await viewer.send(request)
                status = json.loads(await viewer.recv())
                self.assertEqual((status["op"], status["level"]), ("status", 1))
                self.assertIn(words, status["message"], request[:80])
            await viewer.send("x" * 70000)
            with self.assertRaises(ConnectionClosed) as closed:
                await viewer.recv()
            self.assertEqual(closed.exception.rcvd.code, 1009)
        async with contextlib.AsyncExitStack() as stack:
            served = -1
            with self.assertRaises(ConnectionClosed) as closed:
                for served in range(40):
                    await (await stack.enter_async_context(websockets.connect(url, subprotocols=[NEW]))).recv()
            self.assertEqual(closed.exception.rcvd.code, 1013)
            self.assertIn(served, (30, 31, 32))  # the two viewers before may not have gone yet

    def test_only_this_machine_is_listened_to(self):
        with self.watch("--forever") as (_, _, url):
            port = f":{int(url.rsplit(':', 1)[1]):04X}"
            addresses = [line.split()[1] for line in Path("/proc/net/tcp").read_text().splitlines()[1:]
                         if line.split()[1].endswith(port) and line.split()[3] == "0A"]
        self.assertEqual(addresses, ["0100007F" + port])

    def test_bad_usage(self):
        for arguments, status, words in (
                (["--port", "8765"], 1, "--foxglove"), (["--foxglove", "desk_ball", "--port", "70000"], 1, "--port"),
                (["--foxglove", "no_such_scenario"], 1, "no_such_scenario"), (["--foxglove", ""], 1, "--foxglove"),
                (["--foxglove", "desk_ball", "--host", "no such host"], 2, "no such host"),
                (["--foxglove", "desk_ball", "--host", "192.0.2.1"], 2, "192.0.2.1")):
            done = self.command("watch", "--every", "0.1", "--lcm", self.bus, *arguments, status=status)
            self.assertIn(words, done.stderr)
        with socket.create_server(("127.0.0.1", 0)) as taken:
            port = str(taken.getsockname()[1])
            done = self.command("watch", "--every", "0.1", "--lcm", self.bus, "--foxglove", "desk_ball", "--port", port, status=2)
            self.assertIn(f"ballast: port {port} of 127.0.0.1: ", done.stderr)
            self.assertIn("allowed: --port with a port that is free", done.stderr)
            self.assertIn("ballast-foxglove ended with exit status 2", done.stderr)

    def test_the_server_alone_says_what_is_wrong(self):
        server = Path(__file__).resolve().parents[2] / "tools/export/foxglove_server.py"
        stub = self.folder / "stub"
        stub.mkdir()
        (stub / "websockets.py").write_text("raise ImportError")
        named = struct.pack(">Iqqii", 0xEDA1DA01, 0, 0, 10, 1)
        for path, data, words in (
                ("", b"", "standard input: expected robot.json"), ("", b"x" * 28, "standard input: not an LCM event log"),
                ("", named + b"robot.json{", "standard input: expected scenario.toml"),
                ("", named + b"robot.json{" + struct.pack(">Iqqii", 0xEDA1DA01, 0, 0, 13, 0) + b"scenario.toml",
                 "robot.json: not what a run writes"),
                (f"{stub}:", b"", "the package python3-websockets, which is missing")):
            done = subprocess.run(["/usr/bin/python3", "-B", "-s", server, "--port=0"], input=data, capture_output=True, timeout=60,
                                  env={**os.environ, "PYTHONPATH": path + os.environ["PYTHONPATH"]}, check=False)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertTrue(done.stderr.decode().startswith("ballast: ") and words in done.stderr.decode(), done.stderr)

    def test_neither_outlives_the_other(self):
        def server_of(process):
            return int(Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()[0])

        with self.watch("--forever", "--every", "0.1") as (process, said, _):
            os.kill(server_of(process), signal.SIGKILL)
            self.assertEqual(process.wait(PATIENCE_S), 2)
            self.assertIn("ballast-foxglove ended with Killed", "".join(said.all()))
        with self.watch("--forever") as (process, _, _):
            server = server_of(process)
            process.kill()
            process.wait()
            deadline = time.monotonic() + PATIENCE_S
            while Path(f"/proc/{server}").exists() and "State:\tZ" not in Path(f"/proc/{server}/status").read_text():
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.05)


if __name__ == "__main__":
    unittest.main()
