"""ballast-foxglove --host ADDRESS --port N: Shows the messages on standard input to Foxglove, for `ballast watch --foxglove`.

Standard input is an LCM event log that grows while the run goes on. Its first two events are the files robot.json and
scenario.toml; the others are messages of the bus, with the timeline's us. The server ends with its input.

It speaks Foxglove's websocket protocol (https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md): each topic of
messages, frames and scenes is a channel, and viewers say which they want. The timeline is simulated time. A viewer that is
slow gets the newest message of each channel, and no message waits for it. Nothing that a viewer sends goes any further.
"""

import argparse
import asyncio
import json
import struct
import sys
import tempfile
from pathlib import Path

import ballast
from command import COULD_NOT_RUN, run_program
from drawn_robot import NoRobot, read_robot
from event_log import HEADER, SYNC_WORD
from foxglove_scene import RunScene
from foxglove_schemas import SCHEMAS
from json_messages import json_pattern, json_schema
from run_samples import RunSamples
from text import MessageType

try:
    import websockets
    from outbox import Outbox
    from websockets.exceptions import ConnectionClosed
except ImportError:
    print("ballast: Foxglove is served with the package python3-websockets, which is missing; install it", file=sys.stderr)
    sys.exit(COULD_NOT_RUN)

SUBPROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"]  # the same protocol by its new and its old name
MESSAGES = {"BALLAST_CONTACT": ballast.contact_t, "BALLAST_PLANT_STATE": ballast.plant_state_t,
            "BALLAST_CONTROLLER_STATUS": ballast.controller_status_t, "BALLAST_TRIP": ballast.trip_t}
MOST_VIEWERS = 32
_LONGEST_REQUEST = 1 << 16
_LINGER_S = 2  # for viewers to get the last messages
_WARNING = 1  # level of a status message


class Failure(Exception):
    """The server cannot go on. The message says why."""


class Channel:
    """One topic. `newest` is None, or (time in ns, a function that makes the bytes of the newest message)."""

    def __init__(self, number, topic, schema_name, schema):
        self.topic, self.newest = topic, None
        self.advertised = {"id": number, "topic": topic, "encoding": "json", "schemaName": schema_name,
                           "schema": schema, "schemaEncoding": "jsonschema"}

    def put(self, time_ns, make):
        self.newest = time_ns, make

    def message(self):
        """(time in ns, bytes), made once."""
        time_ns, make = self.newest
        data = make()
        self.newest = time_ns, lambda: data
        return time_ns, data


class Viewer(Outbox):
    """One connection."""

    def __init__(self, socket, channels):
        super().__init__(socket)
        self._channels = channels
        self._subscriptions = {}  # number of the subscription by that of the channel

    def show_time(self, time_ns):
        self.put("time", struct.pack("<BQ", 2, time_ns))

    def show(self, number):
        """Sends the newest message of this channel, if the viewer has subscribed to it."""
        subscription = self._subscriptions.get(number)
        channel = self._channels[number]
        if subscription is not None and channel.newest is not None:
            time_ns, data = channel.message()
            self.put(number, struct.pack("<BIQ", 1, subscription, time_ns) + data)

    def take(self, message):
        """A request of the viewer. What it may not ask is answered with a status message."""
        try:
            request = json.loads(message) if isinstance(message, str) else {}
            if request.get("op") == "subscribe":
                for wanted in request["subscriptions"]:
                    self._subscribe(wanted["id"], wanted["channelId"])
            elif request.get("op") == "unsubscribe":
                gone = request["subscriptionIds"]
                self._subscriptions = {key: value for key, value in self._subscriptions.items() if value not in gone}
            else:
                self._refuse("this server only shows: allowed are subscribe and unsubscribe")
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            self._refuse("not a request of Foxglove's websocket protocol")

    def _subscribe(self, subscription, number):
        if type(subscription) is not int or not 0 <= subscription < 2**32 or number not in self._channels:
            self._refuse(f"no such channel: {str(number)[:40]}")
        elif number in self._subscriptions or subscription in self._subscriptions.values():
            self._refuse("subscribed already")
        else:
            self._subscriptions[number] = subscription
            self.show(number)

    def _refuse(self, text):
        self.put("status", json.dumps({"op": "status", "level": _WARNING, "message": f"ballast: {text}"}))


class Show:
    """The run as channels, and its viewers."""

    def __init__(self, robot):
        self._scene, self._samples = RunScene(robot), RunSamples(every_us=1)
        self._types = {topic: MessageType(message_class) for topic, message_class in MESSAGES.items()}
        self._patterns = {topic: json_pattern(message_type) for topic, message_type in self._types.items()}
        self._channels, self._numbers = {}, {}
        for topic, message_type in self._types.items():
            self._add(topic, message_type.name, json_schema(message_type))
        for topic, schema_name in self._scene.topics:
            self._add(topic, schema_name, SCHEMAS[schema_name])
        self.viewers = set()
        self._time_us = 0
        self._run_id = None

    def _add(self, topic, schema_name, schema):
        number = len(self._channels) + 1
        self._channels[number] = Channel(number, topic, schema_name, schema)
        self._numbers[topic] = number

    def greeting(self):
        """The messages with which a connection begins."""
        yield json.dumps({"op": "serverInfo", "name": "ballast", "capabilities": ["time"], "supportedEncodings": ["json"],
                          "metadata": {}})
        yield json.dumps({"op": "advertise", "channels": [channel.advertised for channel in self._channels.values()]})

    async def attend(self, socket):
        """Serves a viewer until its connection ends."""
        if len(self.viewers) >= MOST_VIEWERS:
            await socket.close(1013, f"there are {MOST_VIEWERS} viewers already")
            return
        viewer = Viewer(socket, self._channels)
        viewer.show_time(1000 * (self._time_us or 0))
        self.viewers.add(viewer)
        sender = None
        try:
            for text in self.greeting():
                await socket.send(text)
            sender = asyncio.create_task(viewer.send_all())
            async for message in socket:
                viewer.take(message)
        except ConnectionClosed:
            pass
        finally:
            self.viewers.discard(viewer)
            if sender is not None:
                sender.cancel()

    def take(self, time_us, topic, payload):
        """One message of the bus."""
        message_type = self._types.get(topic)
        if message_type is None or len(payload) != message_type.layout.itemsize:
            return
        (run_id,) = struct.unpack_from(">q", payload, message_type.layout.fields["run_id"][1])
        if run_id != self._run_id or time_us < self._time_us:
            self._begin_run(run_id)
        if time_us != self._time_us:
            self._time_us = time_us
            for viewer in self.viewers:
                viewer.show_time(1000 * time_us)
        self._put(topic, lambda: self._json(topic, payload))
        taken = self._samples.take(time_us, topic, payload)
        if taken is not None and self._scene.matches(taken[0]):
            for drawn, _, message in self._scene.messages(*taken):
                self._put(drawn, lambda message=message: json.dumps(message, separators=(",", ":")).encode())

    def _begin_run(self, run_id):
        self._run_id, self._time_us = run_id, None
        for channel in self._channels.values():
            channel.newest = None
        for viewer in self.viewers:
            viewer.forget()

    def _put(self, topic, make):
        number = self._numbers[topic]
        self._channels[number].put(1000 * self._time_us, make)
        for viewer in self.viewers:
            viewer.show(number)

    def _json(self, topic, payload):
        (row,) = self._types[topic].numbers([payload], topic, infinity="1e999", nan="null")
        return (self._patterns[topic] % row).encode()


async def read_event(reader):
    """(time in us, channel, payload); None at the end of the input."""
    try:
        sync, _, time_us, channel_size, data_size = HEADER.unpack(await reader.readexactly(HEADER.size))
        if sync != SYNC_WORD or min(channel_size, data_size) < 0:
            raise Failure("standard input: not an LCM event log")
        channel = await reader.readexactly(channel_size)
        return time_us, channel.decode(errors="backslashreplace"), await reader.readexactly(data_size)
    except asyncio.IncompleteReadError:
        return None


async def read_described_robot(reader):
    with tempfile.TemporaryDirectory() as folder:
        for name in ("robot.json", "scenario.toml"):
            event = await read_event(reader)
            if event is None or event[1] != name:
                raise Failure(f"standard input: expected {name}")
            (Path(folder) / name).write_bytes(event[2])
        return read_robot(Path(folder))


async def serve(host, port):
    reader = asyncio.StreamReader(limit=1 << 20)
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    show = Show(await read_described_robot(reader))

    async def attend(socket):
        if socket.subprotocol is None:
            await socket.close(1002, f"allowed: the subprotocols {' and '.join(SUBPROTOCOLS)}")
            return
        await show.attend(socket)

    try:
        # Frames on this machine need no compression, and requests are short.
        server = await websockets.serve(attend, host, port, subprotocols=SUBPROTOCOLS, compression=None,
                                        max_size=_LONGEST_REQUEST)
    except OSError as error:
        raise Failure(f"port {port} of {host}: {error.strerror or error}; allowed: --port with a port that is free") from error
    async with server:
        port = server.sockets[0].getsockname()[1]
        print(f"ballast: Foxglove can connect to ws://{'localhost' if host == '127.0.0.1' else host}:{port}", file=sys.stderr,
              flush=True)
        while (event := await read_event(reader)) is not None:
            show.take(max(event[0], 0), event[1], event[2])
        until = asyncio.get_running_loop().time() + _LINGER_S
        while any(not viewer.idle for viewer in show.viewers) and asyncio.get_running_loop().time() < until:
            await asyncio.sleep(0.01)


def main():
    parser = argparse.ArgumentParser(prog="ballast-foxglove", description=__doc__.split(": ", 1)[1].split("\n", 1)[0])
    parser.add_argument("--host", default="127.0.0.1", help="the address of this machine that is listened on")
    parser.add_argument("--port", type=int, default=8765)
    arguments = parser.parse_args()
    return run_program("ballast", lambda: asyncio.run(serve(arguments.host, arguments.port)), Failure, NoRobot)


if __name__ == "__main__":
    sys.exit(main())
