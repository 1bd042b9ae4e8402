"""What the robot knew of itself, beside the truth: the estimate on board, the measured contact force, and the forces and
the path of the robot that was believed. Everything is at the starts of control ticks, from 0 on.

Angles are in degrees here, as people read them. Each quantity has its band: `sigma` is 1 sigma as the robot states it.
"""

import csv
import math
import tomllib
from typing import NamedTuple

import ballast
import numpy as np

from event_log import EventLog, LogError

# A band is drawn, and counted, up to this many sigma. 95 % of normal errors are inside.
BAND_SIGMAS = 2
BAND_NAME = f"\u00b1{BAND_SIGMAS}\u03c3"
# The true bias, which no message has, is shown as a mean over this time. A sample of a usual gyro at 1 kHz is off by 0.3
# degrees/s, such a mean by 0.005: as much as the band, so that it is no measure of it.
BIAS_MEAN_S = 4
# A sigma of 0 stands for what is known for sure, such as the place at the start. Rounding is inside.
_ROUNDING = 1e-9
# Samples below which scale and misalignment are not fitted, and the least change of the rate, as a part of the largest.
_LEAST_FIT = 100
_LEAST_CHANGE = 0.02
_PREDICTION = ("time_s", "position_1_m", "position_2_m", "normal_force_n", "static_friction_n", "mu_required")


class Track(NamedTuple):
    """One quantity over time, in components: as the robot has it, in truth, and the band of the former."""

    value: np.ndarray  # (n, components)
    truth: np.ndarray  # the same shape
    sigma: np.ndarray  # (n,), of each component

    @property
    def error(self):
        return self.value - self.truth

    @property
    def known(self):
        """(n,): the samples that have both."""
        return np.isfinite(self.error).all(axis=1) & np.isfinite(self.sigma)

    def rms(self):
        """Root of the mean square of the error's length."""
        return float(np.sqrt(np.mean(np.sum(self.error[self.known]**2, axis=1)))) if self.known.any() else np.nan

    def largest(self):
        return float(np.linalg.norm(self.error[self.known], axis=1).max()) if self.known.any() else np.nan

    def inside(self):
        """The share of samples, over all components, whose error is inside the band."""
        rows = self.known
        if not rows.any():
            return np.nan
        return float(np.mean(np.abs(self.error[rows]) <= BAND_SIGMAS * self.sigma[rows, None] + _ROUNDING))


class Estimate(NamedTuple):
    """The filter's estimate."""

    time_s: np.ndarray
    tilt_deg: Track    # turn about e1 and e2 that takes true gravity to the estimated one, in the space frame; truth: 0
    yaw_deg: Track     # turn about e3 from the true to the estimated attitude; truth: 0
    bias_degps: Track  # of the gyro, body frame; truth: what it reads beyond the true rate, see _true_bias_radps()
    place_m: Track     # geometric centre, e1 and e2

    @property
    def place_error_m(self):
        return Track(self.place_m.error, np.zeros_like(self.place_m.value), self.place_m.sigma)


class Flag(NamedTuple):
    """A stretch of time in which the robot says that something is wrong."""

    what: str  # "slip" or "light"
    start_s: float
    end_s: float


class Measured(NamedTuple):
    """The contact force as the robot measures it; the truth is of the same tick, so the measurement's age is an error."""

    time_s: np.ndarray
    normal_n: Track
    need: Track        # f_s / N
    slip_mps2: np.ndarray        # magnitude of the contact point's acceleration along the floor
    slip_sigma_mps2: np.ndarray
    flags: list

    @property
    def slipped(self):
        return [flag for flag in self.flags if flag.what == "slip"]


class Predicted(NamedTuple):
    """What the believed robot would have done under the same motion of its masses (belief.csv)."""

    time_s: np.ndarray
    place_m: np.ndarray  # (n, 2)
    normal_n: np.ndarray
    friction_n: np.ndarray
    need: np.ndarray     # NaN where N <= 0

    def place_at(self, time):
        """(n, 2); NaN after the prediction's end."""
        return np.stack([np.interp(time, self.time_s, self.place_m[:, j], right=np.nan) for j in range(2)], axis=1)


def rotated(q, v):
    """(n, 3): vectors v turned by unit quaternions q = w, x, y, z."""
    w, u = q[:, :1], q[:, 1:]
    return v + 2 * np.cross(u, np.cross(u, v) + w * v)


def conjugate(q):
    return q * np.array([1.0, -1, -1, -1])


def _product(p, q):
    w = p[:, :1] * q[:, :1] - np.sum(p[:, 1:] * q[:, 1:], axis=1, keepdims=True)
    return np.hstack([w, p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])])


def _down_W(floor):
    """The direction of weight in the frame of a [surface]."""
    slope = floor.get("slope") or {}
    angle, downhill = float(slope.get("angle", 0)), float(slope.get("downhill", 0))
    return np.array([np.sin(angle) * np.cos(downhill), np.sin(angle) * np.sin(downhill), -np.cos(angle)])


def _downs(folder):
    """The direction of weight in the frame of the true and of the believed floor. Level where nothing says otherwise."""
    try:
        scenario = tomllib.loads((folder / "scenario.toml").read_text(encoding="utf-8"))
        true = scenario.get("surface", {})
        believed = (scenario.get("believed") or {}).get("surface", {})
        slope = {**(true.get("slope") or {}), **(believed.get("slope") or {})}
        return _down_W(true), _down_W({"slope": slope})
    except (OSError, ValueError, TypeError, AttributeError):  # tomllib's errors are ValueErrors
        return _down_W({}), _down_W({})


def tilt_error_rad(estimated, true, down_estimated_W, down_true_W):
    """(n, 2): the turn about e1 and e2 that takes gravity in the body as it is to gravity as it is estimated.

    The attitudes are unit quaternions body -> space, the directions those of weight in the space frame. The turn is seen
    in the space frame as the robot has it, so that an error of heading does not mix its components.
    """
    seen_B, is_B = (rotated(conjugate(q), np.broadcast_to(down, (len(q), 3)))
                    for q, down in ((estimated, down_estimated_W), (true, down_true_W)))
    # The attitude that is turned by +phi has a gravity in the body that is turned by -phi.
    across = np.cross(seen_B, is_B)
    sine, cosine = np.linalg.norm(across, axis=1), np.sum(seen_B * is_B, axis=1)
    angle_per_sine = np.where(sine > 0, np.arctan2(sine, cosine) / np.where(sine > 0, sine, 1), 1)
    return rotated(estimated, across * angle_per_sine[:, None])[:, :2]


def yaw_error_rad(estimated, true):
    """(n,): the turn about e3 from the true attitude to the estimated one, from -pi to pi."""
    turn = _product(estimated, conjugate(true))
    return 2 * np.arctan2(np.where(turn[:, 0] < 0, -turn[:, 3], turn[:, 3]), np.abs(turn[:, 0]))


def _running_mean(values, width):
    """(n, m): the mean over `width` rows around each row; fewer at the ends. Leaves out rows that are NaN."""
    finite = np.isfinite(values)
    sums = np.vstack([np.zeros(values.shape[1]), np.cumsum(np.where(finite, values, 0), axis=0)])
    counts = np.vstack([np.zeros(values.shape[1]), np.cumsum(finite, axis=0)])
    low = np.maximum(np.arange(len(values)) - width // 2, 0)
    high = np.minimum(np.arange(len(values)) + width - width // 2, len(values))
    number = counts[high] - counts[low]
    return np.where(number > 0, (sums[high] - sums[low]) / np.maximum(number, 1), np.nan)


# Injected faults of the gyro under which its readings have no offset from the true rate.
_NO_BIAS = ("sensor_freeze", "sensor_nan", "sensor_spike", "sensor_saturation")


def _faulty(run, time_s, kinds=None):
    """Whether the gyro has an injected fault (of these kinds) at each of the times."""
    found = np.zeros(len(time_s), dtype=bool)
    for fault in run.summary.get("faults") or []:
        if fault.get("sensor") != "gyro" or (kinds is not None and fault["kind"] not in kinds):
            continue
        end_s = fault.get("end")
        found |= (time_s >= fault["time"]) & (time_s <= (math.inf if end_s is None else end_s))
    return found


def _true_bias_radps(run, log_path, state, period_s):
    """(n, 3): what the gyro reads beyond the true rate at these states, without what is proportional to the rate: scale and
    misalignment, which faults do not change. A mean over BIAS_MEAN_S; NaN where a fault leaves no bias to speak of."""
    ticks = state["tick"]
    sensors = EventLog(log_path, ["BALLAST_SENSORS"]).messages("BALLAST_SENSORS", ballast.sensors_t)
    found = np.full((len(ticks), 3), np.nan)
    fresh = np.flatnonzero(np.diff(sensors["imu_count"], prepend=0) > 0)
    taken = sensors["imu_tick"][fresh]
    _, of_sample, of_state = np.intersect1d(taken, state["tick"], return_indices=True)
    rate = np.asarray(state["angular_velocity_B_radps"][of_state], dtype=float)
    beyond = np.asarray(sensors["gyro_B_radps"][fresh[of_sample]], dtype=float) - rate
    time_s = np.asarray(state["time_s"][of_state], dtype=float)
    sound = ~_faulty(run, time_s) & np.isfinite(beyond).all(axis=1)
    if np.count_nonzero(sound) > _LEAST_FIT:
        middle, mean = rate[sound].mean(axis=0), beyond[sound].mean(axis=0)
        # Where the rate hardly changes, nothing tells its share from the bias, and none is taken off.
        share, *_ = np.linalg.lstsq(rate[sound] - middle, beyond[sound] - mean, rcond=_LEAST_CHANGE)
        beyond = beyond - rate @ share
    beyond[_faulty(run, time_s, _NO_BIAS)] = np.nan
    _, here, there = np.intersect1d(ticks, taken[of_sample], return_indices=True)
    found[here] = beyond[there]
    mean = _running_mean(found, max(int(round(BIAS_MEAN_S / period_s)), 1))
    mean[_faulty(run, np.asarray(state["time_s"], dtype=float), _NO_BIAS)] = np.nan
    return mean


def _tick_starts(run):
    """Rows of contact, state and status of the ticks that all three have, at the tick's start; and the period."""
    status, state, contact = run.status, run.state, run.contact
    if len(status) == 0:
        return None
    ticks = np.intersect1d(np.intersect1d(status["tick"], state["tick"]), contact["tick"])
    rows = [np.searchsorted(messages["tick"], ticks) for messages in (contact, state, status)]
    period_s = run.summary.get("control_period")
    if not period_s:
        return None
    # The last sample may lie between two tick starts, where the run ended. No status belongs to it.
    at_start = np.abs(state["time_s"][rows[1]] - ticks * period_s) < 1e-3 * period_s
    if not at_start.any():
        return None
    return contact[rows[0][at_start]], state[rows[1][at_start]], status[rows[2][at_start]], float(period_s)


def read_estimate(run, log_path, folder):
    """None where the attitude is not estimated on board."""
    found = _tick_starts(run) if len(run.status) and (run.status["estimate_valid"] != 0).any() else None
    if found is None:
        return None
    _, state, status, period_s = found
    valid = status["estimate_valid"] != 0

    def known(values):
        values = np.array(values, dtype=float)
        values[~valid] = np.nan
        return values

    def sigma(name, unit=1.0):
        return known(unit * np.asarray(status[name], dtype=float))

    def off(error_rad, name):
        value = known(np.degrees(error_rad))
        return Track(value, np.zeros_like(value), sigma(name, np.degrees(1)))

    estimated, true = (np.asarray(q, dtype=float) for q in (status["estimated_orientation"], state["orientation"]))
    true_down, believed_down = _downs(folder)
    bias = np.degrees(_true_bias_radps(run, log_path, state, period_s))
    return Estimate(np.asarray(state["time_s"], dtype=float),
                    off(tilt_error_rad(estimated, true, believed_down, true_down), "tilt_sigma_rad"),
                    off(yaw_error_rad(estimated, true)[:, None], "yaw_sigma_rad"),
                    Track(known(np.degrees(status["estimated_gyro_bias_B_radps"])), bias,
                          sigma("gyro_bias_sigma_radps", np.degrees(1))),
                    Track(known(status["estimated_position_W_m"]), np.asarray(state["position_W_m"][:, :2], dtype=float),
                          sigma("position_sigma_m")))


def _flags(time, status, period_s):
    found = []
    for what in ("slip", "light"):
        up = np.concatenate([[0], (status[f"{what}_detected"] != 0).astype(int), [0]])
        starts, ends = np.flatnonzero(np.diff(up) > 0), np.flatnonzero(np.diff(up) < 0)
        found += [Flag(what, float(time[a]), float(time[b - 1]) + period_s) for a, b in zip(starts, ends)]
    return sorted(found, key=lambda flag: flag.start_s)


def read_measured(run):
    """None where the contact force is not measured."""
    found = _tick_starts(run) if len(run.status) and (run.status["measured_valid"] != 0).any() else None
    if found is None:
        return None
    contact, state, status, period_s = found
    valid = status["measured_valid"] != 0

    def column(name):
        values = np.array(status[name], dtype=float)
        values[~valid | ~np.isfinite(values)] = np.nan
        return values

    need = np.array(contact["mu_required"], dtype=float)
    need[~np.isfinite(need) | (contact["regime"] == ballast.contact_t.REGIME_FLIGHT)] = np.nan
    normal = np.array(contact["normal_force_n"], dtype=float)
    time = np.asarray(state["time_s"], dtype=float)
    return Measured(time,
                    Track(column("measured_normal_force_n")[:, None], normal[:, None], column("measured_normal_sigma_n")),
                    Track(column("measured_mu_required")[:, None], need[:, None], column("measured_mu_sigma")),
                    column("measured_slip_mps2"), column("measured_slip_sigma_mps2"), _flags(time, status, period_s))


def read_predicted(folder):
    """None where nothing but the truth is believed."""
    path = folder / "belief.csv"
    if not path.exists():
        return None
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        table = np.array([[float(row[name]) for name in _PREDICTION] for row in rows])
    except (KeyError, TypeError, ValueError) as error:
        raise LogError(f"{path}: not what a run writes ({error!r})") from error
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from error
    if len(table) < 2:
        return None
    need = np.where(np.isfinite(table[:, 5]), table[:, 5], np.nan)
    return Predicted(table[:, 0], table[:, 1:3], table[:, 3], table[:, 4], need)


def governed_spans(run):
    """Spans (start_s, end_s) in which the governor bent the command, and those in which the masses were on the backup.
    A command is of the tick after its status."""
    period_s = run.summary.get("control_period")
    if len(run.status) == 0 or not period_s:
        return [], []
    spans = []
    for column in ("command_bent", "backup_active"):
        up = np.concatenate([[0], (run.status[column] != 0).astype(int), [0]])
        starts, ends = np.flatnonzero(np.diff(up) > 0), np.flatnonzero(np.diff(up) < 0)
        ticks = run.status["tick"]
        spans.append([(float(ticks[a] + 1) * period_s, float(ticks[b - 1] + 2) * period_s)
                      for a, b in zip(starts, ends)])
    return spans[0], spans[1]
