"""Picks the samples to draw out of the messages of a run."""

import struct

import numpy as np

import ballast
from event_log import layout_of
from foxglove_scene import sample_of

CONTACT, STATE = "BALLAST_CONTACT", "BALLAST_PLANT_STATE"
EVERY_US = 10_000


class _Newest:
    """The newest message of a channel."""

    def __init__(self, message_class):
        self._layout = layout_of(message_class)
        self._tick, self._last = (self._layout.fields[name][1] for name in ("tick", "last"))
        self.fingerprint = message_class._get_packed_fingerprint()
        self.payload = None

    def holds(self, payload):
        return len(payload) == self._layout.itemsize and payload[:8] == self.fingerprint

    @property
    def tick(self):
        return None if self.payload is None else struct.unpack_from(">q", self.payload, self._tick)[0]

    @property
    def is_last(self):
        return self.payload[self._last] != 0

    def row(self):
        return np.frombuffer(self.payload, dtype=self._layout)[0]


class RunSamples:
    """At most one sample per `every_us` of the timeline, and the run's last.

    `skipped` counts the samples that cannot be drawn: numbers that are not finite, or out of range.
    """

    def __init__(self, every_us=EVERY_US):
        self._every_us = every_us
        self._newest = {CONTACT: _Newest(ballast.contact_t), STATE: _Newest(ballast.plant_state_t)}
        self._drawn_tick = None
        self._next_us = 0
        self.skipped = 0

    def take(self, time_us, channel, payload):
        """(Sample, whether the run ends with it) if this message completes one that is due; else None.

        The time is that of the message on the timeline, >= 0. The countdown before tick 0 is left out.
        """
        newest = self._newest.get(channel)
        if newest is None or not newest.holds(payload):
            return None
        newest.payload = payload
        contact, state = self._newest.values()
        tick = newest.tick
        if tick < 0 or contact.tick != state.tick or tick == self._drawn_tick:
            return None
        if self._drawn_tick is not None and tick < self._drawn_tick:
            self._next_us = 0  # another run
        is_last = contact.is_last or state.is_last
        if time_us < self._next_us and not is_last:
            return None
        self._next_us = time_us // self._every_us * self._every_us + self._every_us
        self._drawn_tick = tick
        sample = sample_of(time_us, contact.row(), state.row())
        if sample is None:
            self.skipped += 1
            return None
        return sample, is_last
