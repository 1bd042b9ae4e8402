"""The differences of two runs: fields of their summaries and robots, and the first tick and field of their logs."""

import json
import math
import re
import struct
from pathlib import Path
from typing import NamedTuple

import ballast
import numpy as np

from event_log import EventLog
from short_number import NEGLIGIBLE, apart, short_difference, short_number

# Fields that identify a run and are not part of its course. The plant draws run_id on a bus; elsewhere it is 0.
_IDENTITY = ("scenario_id", "run_id")
# The fields of a summary that differ between identical runs.
_NEVER_THE_SAME = ("wall_time", "speed")
_CHANNELS = {
    "BALLAST_CONTACT": ballast.contact_t,
    "BALLAST_PLANT_STATE": ballast.plant_state_t,
    "BALLAST_SENSORS": ballast.sensors_t,
    "BALLAST_STEP_COMMAND": ballast.step_command_t,
    "BALLAST_CONTROLLER_STATUS": ballast.controller_status_t,
    "BALLAST_TRIP": ballast.trip_t,
    "BALLAST_OPERATOR": ballast.operator_t,
}


class FieldDifference(NamedTuple):
    """A field that differs. MISSING stands for a run that lacks it."""

    path: str
    a: object
    b: object

    @property
    def difference(self):
        """b - a for two finite numbers, otherwise None."""
        both = (self.a, self.b)
        if all(isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v) for v in both):
            return self.b - self.a
        return None


MISSING = object()

_LCM_TYPES = Path(__file__).resolve().parents[2] / "lcmtypes"
_UNITS = ("1", "N", "N m", "m", "m/s", "m/s^2", "rad", "rad/s", "s", "us", "microsteps", "timer ticks")


def ulps(a, b):
    """The number of doubles from a to b, b included; None unless both are finite floats."""
    if not all(isinstance(v, float) and math.isfinite(v) for v in (a, b)):
        return None
    # Bit patterns of doubles of one sign have the order of the doubles.
    ranks = [pattern if pattern >= 0 else -(pattern + 2**63) for pattern in
             (struct.unpack(">q", struct.pack(">d", v))[0] for v in (a, b))]
    return abs(ranks[1] - ranks[0])


def unit_of(channel, field):
    """The unit at the start of the field's comment in the .lcm file; empty if there is none. 1: a pure number."""
    text = (_LCM_TYPES / f"{_CHANNELS[channel].__name__.removesuffix('_t')}.lcm").read_text()
    comment = re.search(rf"\s{re.escape(field.partition('[')[0])}(?:\[\d+\])*;\s*// *([^\n]*)", text)
    if not comment:
        return ""
    head = re.split("[,;]| since ", comment[1])[0].strip()
    if head.startswith("rail coordinate"):
        return "rad on circles, m elsewhere"
    return head if head in _UNITS else ""


def how_far(channel, field, a, b):
    """' (+0.3 N, 2 ULP)' for two numbers, ' (2 ULP)' if they differ by rounding, otherwise empty."""
    difference = FieldDifference(field, a, b).difference
    if difference is None:
        return ""
    unit = unit_of(channel, field)
    parts = []
    if not abs(difference) < NEGLIGIBLE:
        parts.append(short_difference(difference) + (f" {unit}" if unit and unit != "1" else ""))
    steps = ulps(a, b)
    if steps is not None:
        parts.append(f"{steps if steps < 1e6 else f'{steps:.3g}'} ULP")
    return f" ({', '.join(parts)})" if parts else ""


def value_text(value):
    if value is MISSING:
        return "–"
    if isinstance(value, float):
        return short_number(value)
    return value if isinstance(value, str) else json.dumps(value)


def value_texts(a, b):
    """The values of a field in two runs, with as many digits as tell numbers apart."""
    if isinstance(a, float) and isinstance(b, float):
        return apart(a, b)
    return value_text(a), value_text(b)


class LogDifference(NamedTuple):
    """The differences of one channel. `tick` is None if there are none. `a`, `b` are the first field that differs."""

    channel: str
    messages: tuple           # number of them in a, in b
    tick: int | None          # the first tick with a field that differs, or else the first that only one log has
    field: str                # with its index, as in mass_position[2]; empty: only one log has the message
    a: object
    b: object
    differing: int            # number of messages that both have and that differ

    @property
    def differs(self):
        return self.tick is not None


def summary_differences(a, b, path=""):
    """A FieldDifference for every field that differs, in a's order. `a` and `b` are results of json.loads."""
    if any(isinstance(value, (dict, list)) and value for value in (a, b)):
        children_a, children_b = _children(a), _children(b)
        found = []
        for key in [*children_a, *(key for key in children_b if key not in children_a)]:
            below = f"{path}.{key}" if path else str(key)
            if below not in _NEVER_THE_SAME:
                found += summary_differences(children_a.get(key, MISSING), children_b.get(key, MISSING), below)
        return found
    return [] if a is b or a == b else [FieldDifference(path, a, b)]


def _children(value):
    """The entries of an object or a list. Anything else has none, so that all of the other's entries are missing."""
    if isinstance(value, dict):
        return value
    return dict(enumerate(value)) if isinstance(value, list) else {}


def robot_differences(a, b):
    """A FieldDifference for every field of robot.json that differs, and one for each rail that differs."""
    found = []
    for difference in summary_differences(a, b):
        head, rail, _ = difference.path.partition(".rail")
        if not rail:
            found.append(difference)
        elif not found or found[-1].path != head + rail:
            found.append(FieldDifference(head + rail, "one rail", "another"))
    return found


def log_differences(path_a, path_b):
    """([FieldDifference] of the fields that all messages share, a LogDifference per channel that either log has).

    The fingerprint of the scenario, which is in every message of three channels, is compared once. It and the number of
    the run are left out when messages are compared.
    """
    logs = [EventLog(path, list(_CHANNELS)) for path in (path_a, path_b)]
    ids = [_scenario_id(log) for log in logs]
    common = [FieldDifference("scenario_id", *ids)] if ids[0] != ids[1] else []
    found = []
    for channel, message_class in _CHANNELS.items():
        a, b = (log.messages(channel, message_class) for log in logs)
        if len(a) or len(b):
            found.append(_channel_difference(channel, a, b))
    return common, found


def _scenario_id(log):
    sensors = log.messages("BALLAST_SENSORS", ballast.sensors_t)
    return str(sensors["scenario_id"][0]) if len(sensors) else MISSING


def _channel_difference(channel, a, b):
    # Several messages of one tick, such as the operator's arm and start, are matched by their order.
    keys_a, keys_b = _keys(a), _keys(b)
    _, rows_a, rows_b = np.intersect1d(keys_a, keys_b, assume_unique=True, return_indices=True)
    bytes_a, bytes_b = (_without_identity(rows).view(np.uint8).reshape(len(rows), rows.itemsize)
                        for rows in (a[rows_a], b[rows_b]))
    differing = np.flatnonzero((bytes_a != bytes_b).any(axis=1))
    sizes = len(a), len(b)
    if len(differing):
        one, other = a[rows_a[differing[0]]], b[rows_b[differing[0]]]
        return LogDifference(channel, sizes, int(one["tick"]), *_first_field(one, other), len(differing))
    alone = [rows["tick"][np.isin(keys, others, invert=True)]
             for rows, keys, others in ((a, keys_a, keys_b), (b, keys_b, keys_a))]
    if not any(map(len, alone)):
        return LogDifference(channel, sizes, None, "", None, None, 0)
    first = min(int(ticks.min()) for ticks in alone if len(ticks))
    there = ["none" if first not in ticks else "a message" for ticks in alone]
    return LogDifference(channel, sizes, first, "", *there, 0)


def _without_identity(messages):
    messages = messages.copy()
    for name in _IDENTITY:
        if name in messages.dtype.names:
            messages[name] = 0
    return messages


def _keys(messages):
    """One integer per message, made of its tick and its number within the tick."""
    ticks = np.asarray(messages["tick"], dtype=np.int64)
    order = np.argsort(ticks, kind="stable")
    ordered = ticks[order]
    starts = np.flatnonzero(np.diff(ordered, prepend=ordered[:1] - 1)) if len(ordered) else np.zeros(0, dtype=int)
    number = np.arange(len(ordered)) - np.repeat(starts, np.diff(np.append(starts, len(ordered))))
    keys = np.empty_like(ticks)
    keys[order] = ordered * (1 << 20) + number
    return keys


def _first_field(one, other):
    for name in one.dtype.names:
        a, b = np.atleast_1d(one[name]), np.atleast_1d(other[name])
        if name in _IDENTITY or a.tobytes() == b.tobytes():
            continue
        for index in np.ndindex(a.shape):
            if a[index].tobytes() != b[index].tobytes():
                where = "".join(f"[{i}]" for i in index) if np.ndim(one[name]) else ""
                return name + where, _plain(a[index]), _plain(b[index])
    raise AssertionError("messages of different bytes have a field that differs")


def _plain(value):
    return value.item() if hasattr(value, "item") else value
