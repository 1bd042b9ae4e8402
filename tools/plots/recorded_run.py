"""A finished run's log and summary as arrays over time. Units and frames are those of the .lcm files."""

import json
import math
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import ballast
import numpy as np

from event_log import EventLog, LogError
from floor_patches import read_patches, static_friction_at
from known import read_estimate, read_measured, read_predicted
from planned import read_planned
from summary_shape import check_summary

REGIME_NAMES = {
    ballast.contact_t.REGIME_ROLLING: "rolling",
    ballast.contact_t.REGIME_SLIDING: "sliding",
    ballast.contact_t.REGIME_FLIGHT: "flight",
}
_MONITOR_CAUSES = {
    "normal_force": "$N$ at its limit",
    "friction": "friction at its limit",
    "nonfinite": "a value was not finite",
    "stale": "messages were overdue",
    "missing": "a message was missing",
    "repeated": "a message came twice",
    "disagreement": "plant and controller disagree",
}
_CONTROLLER_CAUSES = {
    "slip_measured": "the robot measures slip",
    "light_measured": "the robot measures too small an $N$",
    "no_estimate": "the robot has lost its estimate",
}
_ENDS = {
    "slipped": "the ball slips",
    "detached": "the ball leaves the surface",
    "inconsistent": "no consistent contact force",
}


def _trip_text(trip):
    """(time, text) of a trip in summary.json."""
    cause, value, limit = trip.get("cause", ""), trip.get("value"), trip.get("limit")
    who = "monitor" if cause in _MONITOR_CAUSES else "controller"
    what = _MONITOR_CAUSES.get(cause) or _CONTROLLER_CAUSES.get(cause) or cause.replace("_", " ")
    if cause == "friction" and value is not None and limit is not None and value <= limit:
        what = "the ball slid"  # on less friction than its floor was to have
    return float(trip["time"]), f"{who} trips: {what}"


def read_json(path):
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise LogError(f"{path}: not valid JSON: {error}") from error


class Motor(NamedTuple):
    """One motor at the samples of `state`, at its shaft, with its extrema from summary.json.

    The margin is the fraction of the available torque that the field leaves unused (physics.md, section 5). The field
    supplies the shaft's torque, drag and detent; in prescribed runs detent is left out, as in the plant. These samples
    cannot tell a rotor that lags its field by more than the angle of greatest torque from one that lags by less;
    `least_margin` can, and is then below 0.
    """

    mass: int                  # number of the mass that it moves
    torque_nm: np.ndarray      # positive drives theta up; in prescribed runs the torque needed, rotor inertia included
    available_nm: np.ndarray   # > 0: the holding torque up to the corner speed, falling with 1 / speed above
    margin: np.ndarray         # 1: nothing used; 0: all used; below 0: more was needed than is available
    greatest_nm: float         # largest |torque|, also between samples
    least_margin: float        # also between samples


class RecordedRun:
    """A run's messages from t = 0 on: `contact` and `state` of the plant, `status` of the controller (may be empty)."""

    def __init__(self, folder, log_path=None, summary=None):
        """`log_path` and `summary`, if given, replace run.lcmlog and summary.json of the folder."""
        folder = Path(folder)
        if not folder.is_dir():
            raise LogError(f"{folder}: no such folder")
        self.summary_path = folder / "summary.json"
        self.summary = read_json(self.summary_path) if summary is None else summary
        check_summary(self.summary, self.summary_path)
        self._folder, self._log_path = folder, log_path or folder / "run.lcmlog"
        log = EventLog(self._log_path, ["BALLAST_CONTACT", "BALLAST_PLANT_STATE", "BALLAST_CONTROLLER_STATUS"])
        self.damage = log.damage
        self.contact = _from_start(log.messages("BALLAST_CONTACT", ballast.contact_t))
        self.state = _from_start(log.messages("BALLAST_PLANT_STATE", ballast.plant_state_t))
        self.status = _from_start(log.messages("BALLAST_CONTROLLER_STATUS", ballast.controller_status_t))
        for channel, messages in (("BALLAST_CONTACT", self.contact), ("BALLAST_PLANT_STATE", self.state)):
            if len(messages) == 0:
                raise LogError(f"{log.path}: no {channel} message" + (f" ({log.damage})" if log.damage else ""))
        self.name = self.summary.get("scenario", folder.name)
        most = self.state["mass_position"].shape[1]
        for tick, count in zip(self.state["tick"], self.state["mass_count"]):
            if not 0 <= count <= most:
                raise LogError(f"{log.path}: BALLAST_PLANT_STATE, tick {tick}: mass_count is {count}; allowed: 0 to {most}")
        self.mass_count = int(self.state["mass_count"][0])
        self.planned = read_planned(folder)
        self.patches = read_patches(folder)

    @cached_property
    def estimate(self):
        """known.Estimate; None where the attitude is not estimated on board."""
        return read_estimate(self, self._log_path, self._folder)

    @cached_property
    def measured(self):
        """known.Measured; None where the contact force is not measured."""
        return read_measured(self)

    @cached_property
    def predicted(self):
        """known.Predicted: what the believed robot would have done; None where nothing but the truth is believed."""
        return read_predicted(self._folder)

    @property
    def commands_as_believed(self):
        """Whether the commanded_ fields are those of another robot or attitude than the true one."""
        return self.predicted is not None or self.estimate is not None

    @property
    def is_stepper(self):
        """False where the masses follow their motion exactly."""
        return self.summary.get("actuation") == "stepper"

    @property
    def static_friction_coefficient(self):
        """mu_s, infinite for perfect friction."""
        value = self.summary.get("surface", {}).get("static_friction")
        return math.inf if value is None else float(value)

    def static_friction_under_ball(self):
        """mu_s under the ball at the samples of `state`; None where the whole floor holds alike."""
        floor = self.static_friction_coefficient
        if all(patch.static_friction == floor for patch in self.patches):
            return None
        places = np.asarray(self.state["position_W_m"][:, :2], dtype=float)
        found = static_friction_at(self.patches, places, floor)
        return found if (found != floor).any() else None

    @property
    def end_s(self):
        """Time of the last sample."""
        return max(float(self.contact["time_s"][-1]), float(self.state["time_s"][-1]))

    def extremum(self, section, value_key, time_key):
        """(value, time) from summary.json, which may lie between samples; None if it has none or an infinite one."""
        entry = self.summary.get(section) or {}
        value, time = entry.get(value_key), entry.get(time_key)
        if isinstance(value, (int, float)) and isinstance(time, (int, float)) and math.isfinite(value):
            return float(value), float(time)
        return None

    def largest_friction_required(self):
        """(f_s / N, time), infinite where N reached 0 (null in summary.json); None without contact."""
        entry = self.summary.get("mu_required") or {}
        if not np.isfinite(self.friction_required()).any() or not isinstance(entry.get("time"), (int, float)):
            return None
        return self.extremum("mu_required", "max", "time") or (math.inf, float(entry["time"]))

    def early_ends(self):
        """(time, text) of the trips and of the physical event that ended the run, in order of time."""
        trip = self.summary.get("trip") or {}
        found = [_trip_text(one) for one in (trip, trip.get("monitor")) if one]
        end = self.summary.get("end", {})
        if end.get("reason") in _ENDS:
            found.append((float(end["time"]), _ENDS[end["reason"]]))
        return sorted(found)

    def spans(self, regime_name):
        """(start, end) of every interval in this contact regime."""
        return [(r["start"], r["end"]) for r in self.summary.get("regimes", []) if r["regime"] == regime_name]

    def leaves_the_ground(self):
        return bool(self.spans("flight"))

    def impact_times(self):
        return [impact["time"] for impact in self.summary.get("impacts", [])]

    def friction_required(self):
        """f_s / N at the samples of `contact`; NaN in flight and where N <= 0."""
        ratio = np.array(self.contact["mu_required"], dtype=float)
        ratio[~np.isfinite(ratio) | (self.contact["regime"] == ballast.contact_t.REGIME_FLIGHT)] = np.nan
        return ratio

    def commanded(self, name):
        """The field commanded_`name` at the samples of `contact`: of each the one of its tick. NaN where there is none.

        Messages of a run with an estimate carry the fields of the tick before.
        """
        ticks, of = self.contact["tick"], self.contact["commanded_tick"]
        rows = np.minimum(np.searchsorted(ticks, of), len(ticks) - 1)
        value = np.asarray(self.contact[f"commanded_{name}"], dtype=float)
        there = (ticks[rows] == of) & ~np.isnan(value)
        found = np.full(len(ticks), np.nan)
        found[rows[there]] = value[there]
        return found

    def commanded_contact(self):
        """(time, {name: (real, commanded)}) of N, f_s and f_s / N at the rolling samples with a command.

        NaN where f_s / N has no bound. None if there is no such sample.
        """
        rows = np.isfinite(self.commanded("normal_force_n"))
        rows &= self.contact["regime"] == ballast.contact_t.REGIME_ROLLING
        if not rows.any():
            return None
        pairs = {}
        for name in ("normal_force_n", "static_friction_n", "mu_required"):
            real, commanded = np.array(self.contact[name][rows], dtype=float), self.commanded(name)[rows]
            real[~np.isfinite(real)] = np.nan
            commanded[~np.isfinite(commanded)] = np.nan
            pairs[name] = real, commanded
        return np.asarray(self.contact["time_s"][rows], dtype=float), pairs

    def greatest_deviation(self, quantity):
        """(real minus commanded, time) of greatest size, from summary.json; None if it has no bound."""
        entry = (self.summary.get("motor_share") or {}).get(quantity) or {}
        difference, time = entry.get("difference"), entry.get("time")
        if isinstance(difference, (int, float)) and isinstance(time, (int, float)):
            return float(difference), float(time)
        return None

    def friction_force_W(self):
        """(n, 2): the horizontal force of the surface on the ball at the times of `state`."""
        contact_s, state_s = self.contact["time_s"], self.state["time_s"]
        force = self.contact["friction_force_W_n"]
        return np.stack([np.interp(state_s, contact_s, force[:, j]) for j in range(2)], axis=1)

    def ball_radius_m(self):
        """The ball's radius, fitted to |zdot| = r |horizontal angular velocity|; None if the ball never rolls."""
        w, x, y, z = np.asarray(self.state["orientation"], dtype=float).T
        up_B = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
        rate_B = np.asarray(self.state["angular_velocity_B_radps"], dtype=float)
        horizontal_squared = np.sum(rate_B**2, axis=1) - np.sum(rate_B * up_B, axis=1)**2
        speed = np.linalg.norm(self.state["velocity_W_mps"][:, :2], axis=1)
        regime = np.interp(self.state["time_s"], self.contact["time_s"], self.contact["regime"])
        rolls = (regime == ballast.contact_t.REGIME_ROLLING) & (horizontal_squared > 0)
        weight = np.sqrt(horizontal_squared[rolls])
        return float(speed[rolls] @ weight / (weight @ weight)) if weight.any() and speed[rolls].any() else None

    def motors(self):
        """One Motor per mass on a rail, in order; a mass on a trajectory has none."""
        entries = self.summary.get("motors", [])
        if len(entries) != self.mass_count:
            raise LogError(f"{self.summary_path}: motors has {len(entries)} entries; the log shows {self.mass_count}")
        found = []
        for i, entry in enumerate(entries):
            if entry is None:
                continue
            try:
                p = entry["parameters"]
                speed_radps = p["shaft_ratio"] * np.asarray(self.state["mass_velocity"][:, i], dtype=float)
                torque_nm = np.asarray(self.state["motor_torque_nm"][:, i], dtype=float)
                available_nm = _available_torque_nm(p, np.abs(speed_radps))
                drawn_nm = torque_nm + p["viscous_damping"] * speed_radps
                if self.is_stepper:
                    shaft_rad = p["shaft_ratio"] * np.asarray(self.state["mass_position"][:, i], dtype=float)
                    drawn_nm = drawn_nm + p["detent_torque"] * np.sin(p["steps_per_revolution"] * shaft_rad)
                found.append(Motor(i, torque_nm, available_nm, 1 - np.abs(drawn_nm) / available_nm,
                                   float(entry["max_torque"]), float(entry["torque_margin"])))
            except KeyError as error:
                raise LogError(f"{self.summary_path}: motors[{i}]: {error} is missing; was this run recorded by "
                               "another version?") from error
        return found

    def commanded_and_true(self):
        """(time, commanded, true) rail coordinates at tick starts that both sides report; None without a controller."""
        if len(self.status) == 0 or self.status["motor_count"][0] == 0:
            return None
        _, status_rows, state_rows = np.intersect1d(self.status["tick"], self.state["tick"], return_indices=True)
        state = self.state[state_rows]
        # The last sample may lie between two tick starts, where the run ended. No command belongs to it.
        period_s = float(self.summary["control_period"])
        at_start = np.abs(state["time_s"] - state["tick"] * period_s) < 1e-3 * period_s
        if not at_start.any():
            return None
        n = self.mass_count
        return (np.asarray(state["time_s"][at_start], dtype=float),
                np.asarray(self.status["commanded_position"][status_rows][at_start, :n], dtype=float),
                np.asarray(state["mass_position"][at_start, :n], dtype=float))


def _available_torque_nm(p, speed_radps):
    """The holding torque up to the corner speed; above, what the supply can drive through the winding.

    Without data of the winding the torque falls with corner speed / speed.
    """
    over_corner = np.maximum(speed_radps / p["corner_speed"], 1)
    if p.get("rated_current") is None:
        return p["holding_torque"] / over_corner
    # Currents are complex numbers in the rotor's frame, with j ahead of the magnet: |i| <= I and |Z i + j E| <= V. The
    # greatest Im i is at the top of the voltage's circle if that lies inside the current's, otherwise where they cross.
    most_a, supply_v = np.sqrt(2) * p["rated_current"], p["supply_voltage"]
    constant = p["holding_torque"] / most_a
    speed = np.where(over_corner > 1, speed_radps, p["corner_speed"])
    z = p["resistance"] + 1j * p["steps_per_revolution"] / 4 * speed * p["inductance"]
    emf = constant * speed
    top = -1j * emf / z + 1j * supply_v / np.abs(z)
    cosine = (supply_v**2 - emf**2 - np.abs(z * most_a)**2) / (2 * emf * np.abs(z) * most_a)
    middle, aside = np.arctan2(z.real, z.imag), np.arccos(np.clip(cosine, -1, 1))
    crossing = np.where(cosine < -1, 0, most_a * np.maximum(np.sin(middle + aside), np.sin(middle - aside)))
    quadrature_a = np.where(np.abs(top) <= most_a, top.imag, crossing)
    limited_nm = constant * np.maximum(quadrature_a, 1e-6 * most_a)
    return np.where(over_corner > 1, limited_nm, p["holding_torque"])


def _from_start(messages):
    """Drops the countdown: the ticks before 0, in which the ball is held."""
    return messages[messages["tick"] >= 0]
