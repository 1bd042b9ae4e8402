"""Reads LCM event logs (run.lcmlog) into numpy arrays.

An event log is a sequence of events, all numbers big-endian:
    uint32 sync word 0xEDA1DA01, int64 event number, int64 timestamp in us, int32 channel length, int32 data length,
    channel, data
Every message of this project has a fixed size, so all messages of one channel are decoded at once. The layout is taken
from the classes that lcm-gen generates.
"""

import io
import json
import mmap
import os
import re
import struct
import types
from pathlib import Path

import numpy as np

SYNC_WORD = 0xEDA1DA01
HEADER = struct.Struct(">Iqqii")  # of an event: sync word, number, time, sizes of channel and data
_FINGERPRINT_SIZE = 8


class LogError(Exception):
    """The log cannot be used. The message names the file and the reason."""


class EventLog:
    """The messages of some channels of a log. `damage` is None, or the place and reason where reading stopped early."""

    def __init__(self, path, channels):
        self.path = path
        self.damage = None
        self._messages = {channel: [] for channel in channels}
        wanted = {channel.encode(): messages for channel, messages in self._messages.items()}

        def take(_, channel, payload):
            if channel in wanted:
                wanted[channel].append(payload)

        self.damage = scan(path, take)

    def messages(self, channel, message_class):
        """All messages of a channel as a structured array with the fields of the .lcm file."""
        payloads = self._messages[channel]
        layout = layout_of(message_class)
        fingerprint = message_class._get_packed_fingerprint()
        for number, payload in enumerate(payloads):
            if payload[:_FINGERPRINT_SIZE] != fingerprint:
                raise LogError(
                    f"{self.path}: {channel}, message {number}: not a {message_class.__name__} of this build "
                    f"(fingerprint {payload[:_FINGERPRINT_SIZE].hex()}, expected {fingerprint.hex()})"
                )
            if len(payload) != layout.itemsize:
                raise LogError(
                    f"{self.path}: {channel}, message {number}: {len(payload)} bytes, expected {layout.itemsize}"
                )
        return np.frombuffer(b"".join(payloads), dtype=layout)


def scan(path, take):
    """Calls take(timestamp, channel, payload) for every event of the log.

    Returns None, or the place and reason where reading stopped early.
    """
    try:
        with open(path, "rb") as file:
            if os.fstat(file.fileno()).st_size == 0:
                raise LogError(f"{path}: the log is empty")
            data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        raise LogError(f"{path}: {_why_no_log(Path(path)) or error.strerror}") from error
    with data:
        return _scan(data, path, take)


def _why_no_log(path):
    """Why a run has no log, by the summary beside it. None: it should have one, or there is no run."""
    try:
        summary = json.loads((path.parent / "summary.json").read_bytes())
    except (OSError, ValueError):
        return None
    says_none = isinstance(summary, dict) and summary.get("log_bytes", "unknown") is None
    if path.exists() or path.name != "run.lcmlog" or not says_none:
        return None
    last = "; blackbox/ there holds the last seconds" if (path.parent / "blackbox" / "run.lcmlog").exists() else ""
    return f"this run was made with --no-log (or by ballast integrate), which keeps no log; run it again without{last}"


def _scan(data, path, take):
    offset, size = 0, len(data)
    while offset < size:
        body = offset + HEADER.size
        if body > size:
            return f"cut off inside an event at byte {offset}"
        sync, _, timestamp, channel_size, data_size = HEADER.unpack_from(data, offset)
        if sync != SYNC_WORD or channel_size < 0 or data_size < 0:
            if offset == 0:
                raise LogError(f"{path}: not an LCM event log")
            return f"damaged at byte {offset}: no event starts there"
        end = body + channel_size + data_size
        if end > size:
            return f"cut off inside an event at byte {offset}"
        take(timestamp, data[body:body + channel_size], data[body + channel_size:end])
        offset = end
    return None


def layout_of(message_class):
    """The numpy layout of an encoded message, fingerprint first."""
    # lcm-gen 1.3 writes no type names into a class. The struct formats that its encoder uses give the types in order,
    # and a fresh object gives the shapes. So the encoder runs once with a `struct` that records formats.
    codes = []

    class RecordedFormats:
        @staticmethod
        def pack(packing, *_):
            for count, code in re.findall(r"(\d*)([a-z?])", packing, re.IGNORECASE):
                codes.extend(code * int(count or 1))
            return b""

    fresh = message_class()
    types.FunctionType(message_class._encode_one.__code__, {"struct": RecordedFormats})(fresh, io.BytesIO())
    fields = [("fingerprint", f"V{_FINGERPRINT_SIZE}")]
    position = 0
    for name in message_class.__slots__:
        shape = np.shape(getattr(fresh, name))
        fields.append((name, np.dtype(">" + codes[position]), shape))
        position += int(np.prod(shape, dtype=int))
    layout = np.dtype(fields)
    if layout.itemsize != len(fresh.encode()):
        raise LogError(f"{message_class.__name__}: not a message of fixed size")
    return layout
