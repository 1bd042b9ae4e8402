"""ballast-live --listen ADDRESS --port N: Serves the page of `ballast live` and passes its operators' requests on.

Standard input is an LCM event log that grows while a run goes on, with the events that tools/ballast/live_feed.h lists. The
server ends with its input. Requests for the controller go to standard output, one JSON object per line.

One port serves the page, its websocket and Foxglove's websocket protocol. All of it needs the token in the address.
"""

import argparse
import asyncio
import http
import json
import logging
import secrets
import socket as sockets
import sys
import tempfile
from pathlib import Path

from command import COULD_NOT_RUN, run_program

try:
    import websockets
except ImportError:
    print("ballast: the page is served with the package python3-websockets, which is missing; install it", file=sys.stderr)
    sys.exit(COULD_NOT_RUN)

from drawn_robot import NoRobot
from foxglove_server import SUBPROTOCOLS as FOXGLOVE, Failure, Show, read_event
from gate import Gate
from live_page import described_run, page
from live_show import SUBPROTOCOL, LiveShow
from packages import PackageError

_LONGEST_REQUEST = 4096
_MOST_WAITING_REQUESTS = 16
_MOST_CONNECTIONS = 128
_UNSENT_BYTES = 1 << 16  # of a viewer's, beyond which its frames replace each other
_ANOTHER_ROBOT = 1012  # the websocket's code for a service that starts again; Foxglove then connects again
_FILES = ("robot.json", "scenario.toml")
_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",  # the address has the token
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Server:
    """The run on standard input, for the page and for Foxglove."""

    def __init__(self):
        self.live = LiveShow(self._pass_on)
        self._files, self._newest = {}, None
        self._foxglove = None
        self.foxglove_sockets = set()

    @staticmethod
    def _pass_on(request):
        print(json.dumps(request), flush=True)

    async def take(self, time_us, channel, payload):
        """One event."""
        if channel in _FILES:
            self._files[channel] = payload
        elif channel == "live.run":
            await self._begin_run(json.loads(payload))
        elif channel == "live.frame":
            self.live.frame(payload.decode())
        elif channel == "live.state":
            self.live.state(json.loads(payload))
        elif channel == "live.course":
            self.live.course(json.loads(payload))
        elif channel == "live.wish":
            self.live.wish(json.loads(payload))
        elif channel == "live.said":
            self.live.said(json.loads(payload))
        elif self._foxglove is not None and self._foxglove.viewers:  # drawing scenes takes time
            self._foxglove.take(max(time_us, 0), channel, payload)

    async def _begin_run(self, run):
        with tempfile.TemporaryDirectory() as folder:
            for name, content in self._files.items():
                (Path(folder) / name).write_bytes(content)
            described, robot = described_run(Path(folder), run)
        if self._files != self._newest:
            self._newest = dict(self._files)
            self._foxglove = Show(robot)
            for socket in list(self.foxglove_sockets):
                asyncio.ensure_future(socket.close(_ANOTHER_ROBOT, "a run of another scenario"))
        self.live.begin_run(described)

    async def attend(self, socket):
        if socket.subprotocol == SUBPROTOCOL:
            await self.live.attend(socket)
        elif socket.subprotocol is None:
            await socket.close(1002, f"allowed: the subprotocols {', '.join([SUBPROTOCOL, *FOXGLOVE])}")
        elif self._foxglove is None:
            await socket.close(1013, "no run has been heard yet")
        else:
            self.foxglove_sockets.add(socket)
            try:
                await self._foxglove.attend(socket)
            finally:
                self.foxglove_sockets.discard(socket)


def connection_class(gate, page_bytes):
    """The class of the server's connections: answers requests for the page, and lets websockets through the gate."""

    class Connection(websockets.WebSocketServerProtocol):
        open_ones = set()

        def connection_made(self, transport):
            super().connection_made(transport)
            if len(self.open_ones) >= _MOST_CONNECTIONS:
                transport.abort()
            else:
                self.open_ones.add(self)

        def connection_lost(self, exc):
            self.open_ones.discard(self)
            super().connection_lost(exc)

        async def process_request(self, path, headers):
            hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
            if len(hosts) != 1 or not gate.is_own_host(hosts[0]):
                return answer(http.HTTPStatus.FORBIDDEN, "Host is not an address of this machine.")
            if not gate.has_token(path):
                return answer(http.HTTPStatus.NOT_FOUND, "The address lacks the right token. `ballast live` prints it whole.")
            if not headers.get_all("Upgrade"):
                return answer(http.HTTPStatus.OK, page_bytes, "text/html; charset=utf-8")
            # Foxglove is a page of another origin. With the token it may look; it cannot operate.
            looks_only = SUBPROTOCOL not in ",".join(headers.get_all("Sec-WebSocket-Protocol"))
            if not looks_only and not all(gate.is_own_origin(origin, hosts[0]) for origin in origins):
                return answer(http.HTTPStatus.FORBIDDEN, "This page is not the server's own.")
            return None

    return Connection


def answer(status, body, kind="text/plain; charset=utf-8"):
    data = body if isinstance(body, bytes) else f"{body}\n".encode()
    return status, {**_HEADERS, "Content-Type": kind}, data


def shown_address(listen, port, token):
    """The address to open. Where all addresses are listened on, the machine's name."""
    name = listen
    if listen in ("0.0.0.0", "::", ""):
        name = sockets.gethostname()
    elif ":" in listen:
        name = f"[{listen}]"
    return f"http://{name}:{port}/{token}/"


async def serve(listen, port):
    reader = asyncio.StreamReader(limit=1 << 20)
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    token = secrets.token_urlsafe(16)
    server = Server()
    logging.getLogger("websockets").setLevel(logging.CRITICAL)  # strangers' requests are no news
    try:
        # Frames on this machine need no compression.
        listening = await websockets.serve(
            server.attend, listen, port, create_protocol=connection_class(Gate(token), page()),
            subprotocols=[SUBPROTOCOL, *FOXGLOVE], compression=None, max_size=_LONGEST_REQUEST,
            max_queue=_MOST_WAITING_REQUESTS, write_limit=_UNSENT_BYTES, close_timeout=2, server_header="ballast")
    except OSError as error:
        raise Failure(f"port {port} of {listen}: {error.strerror or error}; allowed: --port with a port that is free, and "
                      "--listen with an address of this machine") from error
    async with listening:
        address = shown_address(listen, listening.sockets[0].getsockname()[1], token)
        print(f"ballast: open {address}", file=sys.stderr)
        print(f"ballast: Foxglove can connect to {address.replace('http', 'ws', 1)}", file=sys.stderr, flush=True)
        while (event := await read_event(reader)) is not None:
            await server.take(*event)


def main():
    parser = argparse.ArgumentParser(prog="ballast-live", description=__doc__.split(": ", 1)[1].split("\n", 1)[0])
    parser.add_argument("--listen", default="127.0.0.1", help="the address of this machine that is listened on")
    parser.add_argument("--port", type=int, default=8766)
    arguments = parser.parse_args()
    return run_program("ballast", lambda: asyncio.run(serve(arguments.listen, arguments.port)), Failure, NoRobot, PackageError)


if __name__ == "__main__":
    sys.exit(main())
