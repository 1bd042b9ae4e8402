"""What viewers of the live page see, and who of them holds the controls.

Everything that a viewer gets is a whole state that replaces the one before: a viewer that is slow, or comes late, misses
intermediate states and nothing else. All buffers are bounded.

Messages to the page, JSON objects by "op":
    hello     you: this viewer's name
    run       what is drawn of the run (live_page.described_run)
    history   rows: the last 30 s, path: the way driven, [x, y, regime]
    frame     row: numbers, in the order of the run's columns
    state     what tools/ballast/live_feed.h says of live.state
    course    course: what it says of live.course, or null
    wish      wish: what it says of live.wish, or null
    said      lines: the last lines in words, newest last
    controls  holder: the name of the viewer that holds them, or null; viewers: how many there are
    refused   text: why the last request was not passed on
Requests of the page, JSON objects by "op":
    take, release                   the controls
    command  do: arm, start, stop, halt, brake, reset, or move with mass, to, speed_fraction, or go with the place
             to: [x, y] in m and the places via: [[x, y], ..] on the way
A stop, halt or brake is passed on from every viewer, the others only from the one that holds the controls.
"""

import asyncio
import json
import time
from collections import deque

from outbox import Outbox
from thinned_path import ThinnedPath
from websockets.exceptions import ConnectionClosed

SUBPROTOCOL = "ballast.live.v1"
MOST_VIEWERS = 32
HISTORY_S, HISTORY_EVERY_S = 30, 0.05
_MOST_LINES = 60
_PATH_POINTS = 2000
_PATH_STEP = 0.02  # ball radii
_REQUESTS_PER_S, _MOST_AT_ONCE = 20, 40
_BRAKES = ("stop", "halt", "brake")
_COMMANDS = (*_BRAKES, "arm", "start", "reset", "move", "go")
_MOVE_NUMBERS = ("mass", "to", "speed_fraction")
_FARTHEST_PLACE_M, _MOST_VIA = 1e4, 20  # those of tools/go/go_plan.h and tools/ballast/live_go.h


class Stranger(Exception):
    """A viewer that sends what the page does not send. It is disconnected."""


class Refused(Exception):
    """A request that is not passed on, with the reason."""


class Budget:
    """How many requests a viewer may send: some at once, and then so many per second."""

    def __init__(self, now=time.monotonic):
        self._now, self._left, self._at = now, _MOST_AT_ONCE, now()

    def spend(self):
        now = self._now()
        self._left = min(self._left + _REQUESTS_PER_S * (now - self._at), _MOST_AT_ONCE) - 1
        self._at = now
        if self._left < 0:
            raise Stranger("too many requests")


class Viewer(Outbox):
    def __init__(self, socket, name):
        super().__init__(socket)
        self.name, self.budget = name, Budget()

    def forget_run(self):
        """Drops what waits of the run before."""
        for op in ("run", "history", "frame", "course", "wish"):
            self.drop(op)

    def tell(self, op, **fields):
        self.put(op, json.dumps({"op": op, **fields}, separators=(",", ":")))


def _read_number(value):
    if type(value) not in (int, float) or not abs(value) < 1e15:
        raise Stranger("not a number")
    return value


def _read_place(value):
    if not isinstance(value, list) or len(value) != 2:
        raise Stranger("not a place")
    return [_read_number(coordinate) for coordinate in value]


def _read_go(request):
    to, via = _read_place(request.get("to")), request.get("via", [])
    if not isinstance(via, list):
        raise Stranger("not places")
    via = [_read_place(place) for place in via]
    if len(via) > _MOST_VIA:
        raise Refused(f"go: {len(via)} places on the way; allowed: at most {_MOST_VIA}")
    if any(abs(coordinate) > _FARTHEST_PLACE_M for place in (to, *via) for coordinate in place):
        raise Refused(f"go: a place is too far away; allowed: coordinates up to {_FARTHEST_PLACE_M:g} m")
    return {"to": to, "via": via}


def read_request(message):
    """A request of the page as a dict. Raises Stranger, or Refused."""
    try:
        request = json.loads(message) if isinstance(message, str) else None
    except (ValueError, RecursionError) as error:
        raise Stranger("not JSON") from error
    if not isinstance(request, dict) or request.get("op") not in ("take", "release", "command"):
        raise Stranger("not a request")
    if request["op"] != "command":
        return {"op": request["op"]}
    if request.get("do") not in _COMMANDS:
        raise Stranger("not a command")
    fields = {}
    if request["do"] == "move":
        fields = {key: _read_number(request[key]) for key in _MOVE_NUMBERS if key in request}
    elif request["do"] == "go":
        fields = _read_go(request)
    return {"op": "command", "do": request["do"], **fields}


class LiveShow:
    """`pass_on` takes a dict: a request for the controller."""

    def __init__(self, pass_on):
        self._pass_on = pass_on
        self._viewers, self._count, self._holder = set(), 0, None
        self._run = None  # of the message `run`
        self._state = {"phase": "none"}
        self._lines = deque(maxlen=_MOST_LINES)
        self._rows = deque(maxlen=int(HISTORY_S / HISTORY_EVERY_S) + 1)  # JSON texts
        self._path, self._next_s = None, None
        self._indices = None
        self._frame = None  # the newest
        self._course = self._wish = None

    # The run

    def begin_run(self, run):
        self._run = run
        self._rows.clear()
        self._path = ThinnedPath(_PATH_STEP * run["radius"], _PATH_POINTS)
        self._next_s = self._frame = self._course = self._wish = None
        self._indices = [run["columns"].index(name) for name in ("time", "position_0", "position_1", "regime")]
        for viewer in self._viewers:
            viewer.forget_run()
            self._tell_run(viewer)

    def frame(self, text):
        """One frame, as the text of a JSON list."""
        if self._run is None:
            return
        row = json.loads(text)
        if len(row) != len(self._run["columns"]):
            return
        time_s, x, y, regime = (row[index] for index in self._indices)
        if None not in (time_s, x, y, regime):
            self._path.add((x, y), int(regime))
        if self._next_s is None or time_s >= self._next_s:
            self._next_s = time_s + HISTORY_EVERY_S
            self._rows.append(text)
        self._frame = f'{{"op":"frame","row":{text}}}'
        for viewer in self._viewers:
            viewer.put("frame", self._frame)

    def state(self, state):
        self._state = state
        for viewer in self._viewers:
            viewer.tell("state", **state)

    def course(self, course):
        self._course = course
        for viewer in self._viewers:
            viewer.tell("course", course=course)

    def wish(self, wish):
        self._wish = wish
        for viewer in self._viewers:
            viewer.tell("wish", wish=wish)

    def said(self, line):
        self._lines.append(line)
        for viewer in self._viewers:
            viewer.tell("said", lines=list(self._lines))

    def _tell_run(self, viewer):
        viewer.tell("run", **self._run)
        path = [[round(x, 5), round(y, 5), regime] for (x, y), regime in zip(self._path.points, self._path.tags)]
        viewer.put("history", f'{{"op":"history","path":{json.dumps(path)},"rows":[{",".join(self._rows)}]}}')
        if self._frame is not None:
            viewer.put("frame", self._frame)
        if self._course is not None:
            viewer.tell("course", course=self._course)
        if self._wish is not None:
            viewer.tell("wish", wish=self._wish)

    # The viewers

    def _tell_controls(self):
        holder = self._holder.name if self._holder else None
        for viewer in self._viewers:
            viewer.tell("controls", holder=holder, viewers=len(self._viewers))

    async def attend(self, socket):
        """Serves a viewer until its connection ends."""
        if len(self._viewers) >= MOST_VIEWERS:
            await socket.close(1013, f"there are {MOST_VIEWERS} viewers already")
            return
        self._count += 1
        viewer = Viewer(socket, f"viewer {self._count}")
        viewer.tell("hello", you=viewer.name)
        viewer.tell("state", **self._state)
        viewer.tell("said", lines=list(self._lines))
        if self._run is not None:
            self._tell_run(viewer)
        self._viewers.add(viewer)
        self._tell_controls()
        sender = asyncio.create_task(viewer.send_all())
        try:
            async for message in socket:
                viewer.budget.spend()
                try:
                    self._take(viewer, read_request(message))
                except Refused as error:
                    viewer.tell("refused", text=str(error))
        except ConnectionClosed:
            pass
        except Stranger as error:
            await socket.close(1008, str(error))
        finally:
            self._viewers.discard(viewer)
            if self._holder is viewer:
                self._holder = None
            self._tell_controls()
            sender.cancel()

    def _take(self, viewer, request):
        op = request.pop("op")
        if op == "take":
            if self._holder not in (None, viewer):
                viewer.tell("refused", text=f"{self._holder.name} holds the controls; allowed: take them when they are released")
                return
            self._holder = viewer
            self._tell_controls()
        elif op == "release":
            if self._holder is viewer:
                self._holder = None
                self._tell_controls()
        elif request["do"] in _BRAKES or self._holder is viewer:
            self._pass_on({"who": viewer.name, **request})
        else:
            holder = f"{self._holder.name} holds" if self._holder else "nobody holds"
            viewer.tell("refused", text=f"{holder} the controls; allowed without them: stop and halt")
