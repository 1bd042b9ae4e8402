"""What waits to be sent to a viewer on a websocket: the newest frame of each kind, so that its size is bounded."""

import asyncio

from websockets.exceptions import ConnectionClosed

_PATIENCE_S = 10  # for a viewer to take one frame


class Outbox:
    """One viewer's. Frames of the same key replace each other."""

    def __init__(self, socket):
        self._socket = socket
        self._pending, self._wake = {}, asyncio.Event()

    def put(self, key, frame):
        self._pending[key] = frame
        self._wake.set()

    def drop(self, key):
        self._pending.pop(key, None)

    def forget(self):
        self._pending.clear()

    @property
    def idle(self):
        return not self._pending

    async def send_all(self):
        """Sends until the connection ends. A viewer that takes nothing for _PATIENCE_S is disconnected."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            frames = list(self._pending.values())
            self._pending.clear()
            try:
                for frame in frames:
                    await asyncio.wait_for(self._socket.send(frame), _PATIENCE_S)
            except asyncio.TimeoutError:
                self._socket.transport.abort()
                return
            except ConnectionClosed:
                return
