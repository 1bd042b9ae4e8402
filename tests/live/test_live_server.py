"""The live page's server: who is let in, what strangers can do, who may operate, and how much it keeps."""

import asyncio
import base64
import contextlib
import http.client
import json
import math
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import websockets
from websockets.exceptions import ConnectionClosed, InvalidStatusCode

from fed_server import PATIENCE_S, SUBPROTOCOL, FedServer, frame

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools/live"))
from gate import Gate  # noqa: E402

MOST_VIEWERS = 32


class Viewer:
    """A viewer's connection: `newest` has the newest message of each op."""

    def __init__(self, socket_):
        self.socket, self.newest = socket_, {}

    async def until(self, op, wanted=lambda message: True):
        """The first message of that kind for which wanted(message) is true, those that came before included."""
        if op in self.newest and wanted(self.newest[op]):
            return self.newest[op]
        while True:
            message = json.loads(await asyncio.wait_for(self.socket.recv(), PATIENCE_S))
            self.newest[message["op"]] = message
            if message["op"] == op and wanted(message):
                return message

    async def ask(self, op, **fields):
        await self.socket.send(json.dumps({"op": op, **fields}))

    async def closing(self):
        """The code with which the server closes."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                await asyncio.wait_for(self.socket.recv(), PATIENCE_S)
        return self.socket.close_code


@contextlib.asynccontextmanager
async def viewer_of(server, path=None, subprotocols=(SUBPROTOCOL,), **options):
    url = f"ws://127.0.0.1:{server.port}/{server.token if path is None else path}/"
    async with websockets.connect(url, subprotocols=list(subprotocols) or None, max_size=None, ping_interval=None,
                                  **options) as found:
        yield Viewer(found)


def raw_viewer(port, token):
    """A connection after a websocket's handshake, whose frames are up to the caller."""
    raw = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
    key = base64.b64encode(os.urandom(16)).decode()
    raw.sendall((f"GET /{token}/ HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                 f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: {SUBPROTOCOL}\r\n\r\n"
                 ).encode())
    assert b"101" in raw.recv(64)
    return raw


class ServerTest(unittest.IsolatedAsyncioTestCase):
    """Tests of one server, which takes a second to start."""

    @classmethod
    def setUpClass(cls):
        cls.server = FedServer()
        cls.server.__enter__()
        cls.addClassCleanup(cls.server.__exit__)
        cls.server.begin_run()

    async def asyncSetUp(self):
        asyncio.get_running_loop().slow_callback_duration = PATIENCE_S  # a busy machine is no news

    def get(self, path, method="GET", **headers):
        """(status, headers, body)."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=PATIENCE_S)
        self.addCleanup(connection.close)
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()

    async def refused(self, **options):
        """The HTTP status with which a websocket is refused."""
        with self.assertRaises(InvalidStatusCode) as raised:
            async with viewer_of(self.server, **options):
                pass
        return raised.exception.status_code

    async def works(self):
        """The server still serves a viewer."""
        async with viewer_of(self.server) as viewer:
            await viewer.until("hello")


class LetIn(ServerTest):
    def test_the_page_needs_the_token(self):
        status, headers, body = self.get(f"/{self.server.token}/")
        self.assertEqual(status, 200)
        self.assertTrue(body.startswith(b"<!doctype html>\n<!-- ballast live -->"))
        self.assertIn(b"connect-src 'self'", body)
        self.assertEqual(headers["Referrer-Policy"], "no-referrer")
        self.assertEqual(headers["X-Frame-Options"], "DENY")
        self.assertNotIn(self.server.token.encode(), body)
        for path in ("/", "/favicon.ico", "/x/", f"/{self.server.token}x/", f"/{self.server.token[:-1]}/", "//",
                     f"/{self.server.token}/more", f"/x/{self.server.token}/", "/%00", "/%C3%A9"):
            with self.subTest(path):
                status, _, body = self.get(path)
                self.assertEqual(status, 404)
                self.assertLess(len(body), 200)

    def test_another_host_is_refused(self):
        """As a page would have it whose name was made to resolve to this machine."""
        for host in ("evil.example", "evil.example:80", "localhost.evil.example", "", "[", "127.0.0.1.evil.example"):
            with self.subTest(host):
                self.assertEqual(self.get(f"/{self.server.token}/", Host=host)[0], 403)
        for host in ("localhost:1", "127.0.0.1", "[::1]:8766", socket.gethostname()):
            with self.subTest(host):
                self.assertEqual(self.get(f"/{self.server.token}/", Host=host)[0], 200)

    def test_other_methods_are_refused(self):
        with self.assertRaises((http.client.HTTPException, AssertionError, ConnectionError)):
            self.assertEqual(self.get(f"/{self.server.token}/", method="POST")[0], 200)

    async def test_websockets_need_token_and_origin(self):
        own = f"http://127.0.0.1:{self.server.port}"
        self.assertEqual(await self.refused(path="x"), 404)
        self.assertEqual(await self.refused(path="x", origin=own), 404)
        for origin in ("http://evil.example", "https://127.0.0.1", "http://127.0.0.1:1", f"ftp://127.0.0.1:{self.server.port}",
                       "null", "file://", f"http://127.0.0.1:{self.server.port}.evil.example"):
            with self.subTest(origin):
                self.assertEqual(await self.refused(origin=origin), 403)
        self.assertEqual(await self.refused(extra_headers={"Host": "evil.example"}), 403)
        for origin in (own, None):
            async with viewer_of(self.server, origin=origin) as viewer:
                self.assertEqual(await viewer.until("hello", lambda m: m["you"].startswith("viewer ")) is None, False)

    async def test_a_subprotocol_is_needed(self):
        async with viewer_of(self.server, subprotocols=()) as viewer:
            self.assertEqual(await viewer.closing(), 1002)

    def test_gate(self):
        gate = Gate("secret")
        self.assertTrue(gate.has_token("/secret") and gate.has_token("/secret/") and gate.has_token("/secret/?x=1"))
        for path in ("", "/", "secret", "/Secret/", "/secret/a", "/secr%65t/", "?secret", "/\ud800/"):
            self.assertFalse(gate.has_token(path), path)
        self.assertTrue(gate.is_own_origin("http://LOCALHOST:8", "localhost:8"))
        self.assertFalse(gate.is_own_origin("http://localhost:8@evil.example", "localhost:8"))


class Strangers(ServerTest):
    async def test_what_the_page_does_not_send_disconnects(self):
        for message in ("", "{", b"\x00\x01", "[]", "3", "null", '{"op": 1}', '{"op": "go"}', '{"op":"command"}',
                        '{"op":"command","do":"rm"}', '{"op":"command","do":["arm"]}', "[" * 4000,
                        '{"op":"command","do":"move","mass":"0","to":1}', '{"op":"command","do":"move","mass":true}',
                        '{"op":"command","do":"move","mass":0,"to":NaN}', '{"op":"command","do":"move","mass":0,"to":1e999}',
                        *(f'{{"op":"command","do":"go"{fields}}}' for fields in (
                            "", ',"to":1', ',"to":"1,2"', ',"to":{"x":1,"y":2}', ',"to":[1]', ',"to":[1,2,3]', ',"to":[1,"2"]',
                            ',"to":[1,true]', ',"to":[1,null]', ',"to":[NaN,0]', ',"to":[0,Infinity]', ',"to":[-1e999,0]',
                            ',"to":[1,[2]]', ',"to":[1,2],"via":1', ',"to":[1,2],"via":[1,2]', ',"to":[1,2],"via":[[1]]',
                            ',"to":[1,2],"via":[[1,NaN]]', ',"to":[1,2],"via":{}', ',"to":[1,2],"via":null'))):
            with self.subTest(message):
                async with viewer_of(self.server) as viewer:
                    await viewer.socket.send(message)
                    self.assertEqual(await viewer.closing(), 1008)
        self.assertEqual(self.server.requests, [])
        await self.works()

    async def test_oversized_messages_disconnect(self):
        async with viewer_of(self.server) as viewer:
            await viewer.socket.send('{"op":"take"' + " " * 5000 + "}")
            self.assertEqual(await viewer.closing(), 1009)
        await self.works()

    async def test_too_many_requests_disconnect(self):
        async with viewer_of(self.server) as viewer:
            with contextlib.suppress(ConnectionClosed):
                for _ in range(200):
                    await viewer.ask("release")
            self.assertEqual(await viewer.closing(), 1008)
        await self.works()

    def handshake(self):
        raw = raw_viewer(self.server.port, self.server.token)
        self.addCleanup(raw.close)
        return raw

    @staticmethod
    def read_to_end(raw):
        with contextlib.suppress(ConnectionError):
            while raw.recv(1 << 16):
                pass

    async def test_malformed_frames_disconnect(self):
        reading = []
        for _, data in (("unmasked", b"\x81\x02{}"), ("reserved bits", b"\xf1\x80abcd"), ("reserved opcode", b"\x83\x80abcd"),
                           ("length of 2^63", b"\x81\xff" + b"\xff" * 8), ("long ping", b"\x89\xfe\x00\x80abcd"),
                           ("not UTF-8", b"\x81\x82\x00\x00\x00\x00\xff\xff"), ("continued nothing", b"\x80\x80abcd"),
                        ("noise", os.urandom(200))):
            raw = await asyncio.to_thread(self.handshake)
            raw.sendall(data)
            reading.append(asyncio.to_thread(self.read_to_end, raw))
        for _, data in (("noise", os.urandom(500) + b"\r\n\r\n"), ("no headers", b"GET / HTTP/1.1\r\n\r\n"),
                           ("long line", b"GET /" + b"x" * 100_000),
                        ("many headers", b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 5000)):
            raw = socket.create_connection(("127.0.0.1", self.server.port), PATIENCE_S)
            self.addCleanup(raw.close)
            with contextlib.suppress(ConnectionError):
                raw.sendall(data)
            reading.append(asyncio.to_thread(self.read_to_end, raw))
        await asyncio.gather(*reading)  # which end when the server closes
        await self.works()

    async def test_a_hundred_viewers(self):
        self.server.frames([frame(0.0)])
        async with contextlib.AsyncExitStack() as stack:
            viewers = [await stack.enter_async_context(viewer_of(self.server)) for _ in range(100)]
            for viewer in viewers[MOST_VIEWERS:]:
                self.assertEqual(await viewer.closing(), 1013)
            self.server.frames([frame(0.1 * k) for k in range(1, 20)])
            for viewer in viewers[:MOST_VIEWERS]:
                await viewer.until("frame", lambda message: message["row"][0] == 0.1 * 19)
            await viewers[0].until("controls", lambda message: message["viewers"] == MOST_VIEWERS)
        await self.works()

    async def test_idle_connections_are_limited(self):
        raw = []
        for _ in range(160):
            raw.append(socket.create_connection(("127.0.0.1", self.server.port), PATIENCE_S))
            self.addCleanup(raw[-1].close)
        await asyncio.to_thread(self.read_to_end, raw[-1])
        for connection in raw:
            connection.close()
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                await self.works()
                return
            except (OSError, websockets.exceptions.WebSocketException):
                self.assertLess(time.monotonic(), deadline)
                await asyncio.sleep(0.1)

    async def test_a_viewer_that_never_reads_is_dropped_and_keeps_nobody_waiting(self):
        stuck = [self.handshake() for _ in range(8)]
        async with viewer_of(self.server) as viewer:
            await viewer.until("run")
            before = self.server.resident_mb()
            count = 0
            start = time.monotonic()
            # 300 B per frame: far more than the sockets' buffers, for longer than the server's patience of 10 s.
            while time.monotonic() - start < 12:
                self.server.frames([frame(0.02 * (count + k)) for k in range(500)])
                count += 500
                newest = 0.02 * (count - 1)
                message = await viewer.until("frame", lambda message: math.isclose(message["row"][0], newest))
            self.assertGreater(count, 5000)
            self.assertLess(self.server.resident_mb() - before, 16, "MB")
            await viewer.until("controls", lambda message: message["viewers"] == 1)  # the others are gone
            self.assertIsNotNone(message)
        for raw in stuck:
            await asyncio.to_thread(self.read_to_end, raw)


class Operators(ServerTest):
    async def test_one_operator_at_a_time(self):
        async with viewer_of(self.server) as second:
            async with viewer_of(self.server) as first:
                mine, others = [(await viewer.until("hello"))["you"] for viewer in (first, second)]
                self.assertNotEqual(mine, others)
                await first.ask("command", do="arm")
                refused = await first.until("refused")
                self.assertEqual(refused["text"], "nobody holds the controls; allowed without them: stop and halt")
                await first.ask("take")
                for viewer in (first, second):
                    await viewer.until("controls", lambda message: message["holder"] == mine)
                await second.ask("take")
                refused = await second.until("refused")
                self.assertEqual(refused["text"], f"{mine} holds the controls; allowed: take them when they are released")
                for what in ("arm", "start", "reset", "move", "go"):
                    del second.newest["refused"]
                    await second.ask("command", do=what, **({"to": [1, 2]} if what == "go" else {}))
                    refused = await second.until("refused")
                    self.assertEqual(refused["text"], f"{mine} holds the controls; allowed without them: stop and halt")
                await second.ask("release")  # of what it does not hold
                await first.ask("command", do="arm")
                await first.ask("command", do="move", mass=0, to=0.05, speed_fraction=0.5, more="ignored")
                self.server.wait_for_requests(2)
                for what in ("stop", "halt", "brake"):
                    await second.ask("command", do=what)
                requests = self.server.wait_for_requests(5)
                self.assertEqual(requests, [
                    {"who": mine, "do": "arm"}, {"who": mine, "do": "move", "mass": 0, "to": 0.05, "speed_fraction": 0.5},
                    *({"who": others, "do": what} for what in ("stop", "halt", "brake"))])
                await first.ask("release")
                await second.until("controls", lambda message: message["holder"] is None)
                await second.ask("take")
                await first.until("controls", lambda message: message["holder"] == others)
                await second.ask("release")
                await first.ask("take")
                await second.until("controls", lambda message: message["holder"] == mine)
            # A holder that goes away leaves the controls.
            await second.until("controls", lambda message: message["holder"] is None)
            await second.ask("take")
            await second.until("controls", lambda message: message["holder"] == others)
        self.assertEqual(len(self.server.requests), 5)

    async def test_places_to_go_to(self):
        before = len(self.server.requests)
        async with viewer_of(self.server) as viewer:
            mine = (await viewer.until("hello"))["you"]
            await viewer.ask("take")
            for fields, words in (({"to": [1.1e4, 0]}, "go: a place is too far away; allowed: coordinates up to 10000 m"),
                                  ({"to": [0, 1], "via": [[0, -1e14]]}, "go: a place is too far away; "),
                                  ({"to": [0, 1], "via": [[0, 0]] * 21}, "go: 21 places on the way; allowed: at most 20")):
                viewer.newest.pop("refused", None)
                await viewer.ask("command", do="go", **fields)
                self.assertTrue((await viewer.until("refused"))["text"].startswith(words), viewer.newest["refused"])
            await viewer.ask("command", do="go", to=[-1e4, 0], more="ignored")
            await viewer.ask("command", do="go", to=[1, 2.5], via=[[0, -3]] * 20)
            self.assertEqual(self.server.wait_for_requests(before + 2)[before:], [
                {"who": mine, "do": "go", "to": [-1e4, 0], "via": []},
                {"who": mine, "do": "go", "to": [1, 2.5], "via": [[0, -3]] * 20}])


class Shown(ServerTest):
    async def test_who_comes_late_gets_what_was(self):
        self.server.begin_run()
        self.server.send("live.said", {"kind": "run", "text": "run of made_up"})
        self.server.frames([frame(0.02 * k, x=0.002 * k) for k in range(3000)])
        async with viewer_of(self.server) as early:
            await early.until("frame", lambda message: message["row"][0] == 0.02 * 2999)
            async with viewer_of(self.server) as late:
                run = await late.until("run")
                self.assertEqual((run["name"], run["radius"], run["static_friction"]), ("made_up", 0.15, 0.5))
                self.assertEqual(run["masses"][0]["unit"], "m")
                history = await late.until("history")
                times = [row[0] for row in history["rows"]]
                self.assertLessEqual(len(times), 601)
                self.assertGreater(times[-1] - times[0], 29)
                self.assertGreater(times[-1], 59.9)
                path = history["path"]
                self.assertEqual(path[0], [0, 0, 0])
                self.assertGreater(path[-1][0], 5.9)
                self.assertEqual((await late.until("said"))["lines"][-1]["text"], "run of made_up")
                self.assertEqual((await late.until("state"))["mode"], "armed")
                self.assertNotIn("course", {**early.newest, **late.newest})
                # The next run begins anew, for both.
                self.server.begin_run("another")
                self.server.frames([frame(0.0)])
                for viewer in (early, late):
                    await viewer.until("run", lambda message: message["name"] == "another")
                    await viewer.until("history", lambda message: message["rows"] == [] and message["path"] == [])
                    await viewer.until("frame", lambda message: message["row"][0] == 0)

    async def test_courses_and_wishes(self):
        """Who comes late gets the course in force and the wish under way; the next run has neither."""
        self.server.begin_run()
        wish = {"who": "viewer 1", "to": [1, 0.5], "via": [[0.2, 0]]}
        course = {"number": "2f", "path": [[0, 0], [0.2, 0], [1, 0.5]], "to": [1, 0.5], "via": [[0.2, 0]]}
        async with viewer_of(self.server) as early:
            await early.until("run")
            self.server.send("live.wish", wish)
            self.server.flush()
            self.assertEqual((await early.until("wish"))["wish"], wish)
            self.server.send("live.course", course)
            self.server.flush()
            self.assertEqual((await early.until("course"))["course"], course)
            async with viewer_of(self.server) as late:
                self.assertEqual((await late.until("wish"))["wish"], wish)
                self.assertEqual((await late.until("course"))["course"], course)
            self.server.send("live.wish", "null")
            self.server.flush()
            await early.until("wish", lambda message: message["wish"] is None)
            self.server.begin_run("another")
            self.server.frames([frame(0.0)])
            async with viewer_of(self.server) as late:
                await late.until("frame")
                await late.until("controls")
                self.assertNotIn("course", late.newest)
                self.assertNotIn("wish", late.newest)

    async def test_foxglove_looks_through_the_same_port(self):
        async def advertised(**options):
            async with viewer_of(self.server, subprotocols=["foxglove.websocket.v1"], **options) as viewer:
                info, channels = [json.loads(await asyncio.wait_for(viewer.socket.recv(), PATIENCE_S)) for _ in range(2)]
                self.assertEqual(info["op"], "serverInfo")
                await viewer.ask("command", do="stop")
                while not isinstance(answer := await asyncio.wait_for(viewer.socket.recv(), PATIENCE_S), str):
                    pass  # the time
                self.assertIn("this server only shows", answer)
                return {channel["topic"] for channel in channels["channels"]}

        self.assertEqual(self.server.foxglove, f"ws://127.0.0.1:{self.server.port}/{self.server.token}/")
        async with viewer_of(self.server) as page:
            await page.until("run")
        topics = await advertised(origin="https://app.foxglove.dev")
        self.assertTrue({"BALLAST_CONTACT", "/frames/ball", "/scene/contact"} <= topics)
        self.assertEqual(self.server.requests, [])
        self.assertEqual(await self.refused(path="x", subprotocols=["foxglove.sdk.v1"]), 404)

    async def test_eight_hours_take_no_more_memory_than_one(self):
        self.server.begin_run()
        count, used = 24_000, []
        async with viewer_of(self.server) as viewer:
            for hour in range(8):
                first = hour * count // 8
                rows = [frame(1.2 * k, x=math.sin(0.01 * k) * 0.001 * k, y=0.0005 * k) for k in range(first, first + count // 8)]
                await asyncio.to_thread(self.server.frames, rows)
                self.server.send("live.said", {"kind": "mode", "text": "x" * 200, "time": 1.2 * first})
                await viewer.until("frame", lambda message: math.isclose(message["row"][0], rows[-1][0]))
                used.append(self.server.resident_mb())
        print(f"server after 1 and 8 simulated hours: {used[0]:.1f} and {used[-1]:.1f} MB")
        self.assertLess(used[-1] - used[0], 4, f"MB; {used}")


class OnABus(unittest.TestCase):
    """`ballast live` beside a run."""

    def test_the_run_never_waits(self):
        bus, ballast = f"udpm://239.255.76.67:{20000 + os.getpid() % 40000}?ttl=0", os.environ["BALLAST"]
        with (tempfile.TemporaryDirectory() as folder,
              subprocess.Popen([ballast, "live", "--lcm", bus, "--port", "0"], stderr=subprocess.PIPE, text=True) as live,
              contextlib.ExitStack() as stack):
            stack.callback(live.terminate)
            port, token = re.match(r"ballast: open http://[^:]+:(\d+)/(\S+)/$", live.stderr.readline()).groups()
            children = Path(f"/proc/{live.pid}/task/{live.pid}/children").read_text(encoding="utf-8").split()
            for _ in range(MOST_VIEWERS):
                stack.enter_context(raw_viewer(int(port), token))
            for stopped in (False, True):
                if stopped:
                    os.kill(int(children[0]), signal.SIGSTOP)
                    stack.callback(os.kill, int(children[0]), signal.SIGCONT)
                done = subprocess.run([ballast, "run", "desk_ball", "--set", "duration=2", "--speed", "1", "--lcm", bus,
                                       "--no-log", "--quiet", "--out", folder], capture_output=True, text=True, check=False)
                self.assertEqual(done.returncode, 0, done.stderr)
                summary = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
                # A busy machine delays a run too; a run that waited for a viewer would never end.
                print(f"a run of 2 s at speed 1 took {summary['wall_time']:.4f} s")
                self.assertLess(summary["wall_time"], 4)


class BeginAndEnd(unittest.IsolatedAsyncioTestCase):
    async def asyncSetUp(self):
        asyncio.get_running_loop().slow_callback_duration = PATIENCE_S

    async def test_before_the_first_run_and_after_the_input(self):
        with FedServer() as server:
            async with viewer_of(server, subprotocols=["foxglove.sdk.v1"]) as viewer:
                self.assertEqual(await viewer.closing(), 1013)
            async with viewer_of(server) as viewer:
                self.assertEqual((await viewer.until("state"))["phase"], "none")
                self.assertEqual(await asyncio.to_thread(server.end), 0)
                self.assertEqual(await viewer.closing(), 1001)

    def test_a_port_that_is_taken(self):
        with socket.create_server(("127.0.0.1", 0)) as taken:
            port = taken.getsockname()[1]
            said = f"port {port} of 127.0.0.1: .*; allowed: --port with a port that is free"
            with self.assertRaisesRegex(AssertionError, said):
                FedServer("--port", str(port)).__enter__()


if __name__ == "__main__":
    unittest.main()
