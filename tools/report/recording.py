"""A run as the page shows it: a table of samples, the robot, and the summary.

The sources are run.lcmlog, summary.json and robot.json. If a log has no summary beside it, `from_log` is true and the
summary is computed from the log, as far as possible and with the same names; a black box adds the scenario's data and
the reason why the run could not go on. The summary is also computed from a log that ends at another time than
summary.json says.
"""

import math
from functools import cached_property
from pathlib import Path

import ballast
import numpy as np

from event_log import EventLog, LogError
from recorded_run import REGIME_NAMES, RecordedRun, read_json
from short_number import short_number, short_time

# More samples than this are thinned. 20 s at 1 kHz are shown in full. Twice the pixels of the widest plot would do for
# the whole run; the rest is for zooming in.
MOST_SAMPLES = 30000

# The keys of summary.json that do not depend on how far the run got.
_SAID_BEFORE_THE_RUN = ("scenario", "actuation", "surface", "envelope", "control_period", "seed")
# Tolerance on the time of the end: both files have all digits of it, so this covers rounding only.
_SAME_END = 1e-9

_TRIP_CAUSES = {
    ballast.trip_t.CAUSE_NORMAL_FORCE: "normal_force",
    ballast.trip_t.CAUSE_FRICTION: "friction",
    ballast.trip_t.CAUSE_NONFINITE: "nonfinite",
    ballast.trip_t.CAUSE_STALE: "stale",
    ballast.trip_t.CAUSE_MISSING: "missing",
    ballast.trip_t.CAUSE_REPEATED: "repeated",
    ballast.trip_t.CAUSE_DISAGREEMENT: "disagreement",
}


class Recording:
    """`columns` maps names to arrays with a row per sample. `notes` are sentences on what is missing or left out."""

    def __init__(self, path):
        path = Path(path)
        if not path.exists():
            raise LogError(f"{path}: no such file or folder")
        self.log_path = path / "run.lcmlog" if path.is_dir() else path
        self.folder = self.log_path.parent
        self.notes = []
        self.faults = []  # the notes about damaged files
        summary_path = self.folder / "summary.json"
        # A summary beside a log of another name does not belong to that log.
        self.from_log = self.log_path.name != "run.lcmlog" or not summary_path.exists()
        written = {} if self.from_log else _mapping(summary_path)
        self._run = RecordedRun(self.folder, self.log_path, written)
        self._refuse_two_runs()
        self.summary = self._said_by(written)
        if self._run.damage:
            self.faults.append(f"{self.log_path.name}: {self._run.damage}. The page shows what comes before.")
            self.notes += self.faults
        self.mass_count = self._run.mass_count
        self.robot = self._read_robot()
        self.planned = self._run.planned
        self.patches = self._run.patches
        self.estimate, self.measured = self._run.estimate, self._run.measured
        # A log of another name lies beside the prediction of another run.
        self.predicted = None if self.from_log else self._run.predicted
        self.commands_as_believed = self.predicted is not None or self.estimate is not None
        self.columns = self._columns()
        self._thin()

    def driven(self):
        """(n, 2): the places of the geometric centre, at every state of the log."""
        return np.asarray(self._run.state["position_W_m"][:, :2], dtype=float)

    def columns_place(self):
        """(n, 2): the same at the samples of `columns`."""
        return np.stack([np.asarray(self.columns[f"position_{j}"], dtype=float) for j in range(2)], axis=1)

    @property
    def name(self):
        """The scenario's name if the summary has it, otherwise the name of the log or of its folder."""
        own = self.log_path.name if self.log_path.name != "run.lcmlog" else self.folder.resolve().name
        return str(self.summary.get("scenario") or own)

    @property
    def files(self):
        """The files that a run leaves in its folder. None of them may be overwritten."""
        return [self.log_path, *(self.folder / name for name in ("summary.json", "robot.json", "scenario.toml",
                                                                "belief.csv"))]

    @property
    def end_s(self):
        return self._run.end_s

    @property
    def static_friction_coefficient(self):
        """mu_s: infinite for perfect friction, None if it is not known."""
        if "surface" not in self.summary:
            return None
        return self._run.static_friction_coefficient

    @cached_property
    def static_friction_under_ball(self):
        """mu_s under the ball at every state of the log; None where the whole floor holds alike, or it is not known."""
        return None if self.static_friction_coefficient is None else self._run.static_friction_under_ball()

    @property
    def under_ball_time_s(self):
        return np.asarray(self._run.state["time_s"], dtype=float)

    def static_friction_under(self, time_s):
        """mu_s under the ball at the state nearest to a time; None where static_friction_under_ball is."""
        found = self.static_friction_under_ball
        return None if found is None else float(found[np.argmin(np.abs(self.under_ball_time_s - time_s))])

    def scarcest_friction(self, beside_s):
        """Where the floor left least, in words; empty for the time `beside_s`, a ball that slides and perfect friction."""
        if self._run.spans("sliding"):
            return ""
        contact = self._run.contact
        part = 1 - np.asarray(contact["margin"], dtype=float)
        rolls = (contact["regime"] == ballast.contact_t.REGIME_ROLLING) & np.isfinite(part)
        if not rolls.any() or part[rolls].max() <= 0:
            return ""
        rows = np.flatnonzero(rolls)
        row = rows[np.argmax(part[rows])]
        time, period_s = float(contact["time_s"][row]), float(self.summary.get("control_period") or 0)
        if abs(time - beside_s) <= 2 * period_s:
            return ""
        return (f"the floor had least to spare at t\u00a0=\u00a0{short_time(time)}\u00a0s, where f_s/N was "
                f"{100 * float(part[row]):.0f} % of mu_s = {short_number(self.static_friction_under(time))}")

    def motors(self):
        """RecordedRun.motors(), or none where the motors' parameters are not known."""
        return [] if self.from_log else self._run.motors()

    def _said_by(self, written):
        """The summary of what the log holds: summary.json, or computed from the log."""
        name = self.log_path.name
        if self.from_log:
            box = self._black_box()
            said, end = box.get("summary", {}), box.get("end", {})
            written.update(summary_from_log(self._run, self.log_path))
            written.update({key: said[key] for key in _SAID_BEFORE_THE_RUN if key in said})
            self.notes.append(f"There is no summary.json for {name}: all numbers are from its samples, and whatever a "
                              "log does not hold is left out.")
            if end.get("reason") == "could_not_go_on":
                self.notes.append(f"The run could not go on: {end['text']} (blackbox.json).")
            return written
        end_s = (written.get("end") or {}).get("time")
        if end_s is None or abs(end_s - self.end_s) <= _SAME_END * max(end_s, 1):
            return written
        self.notes.append(f"{name} ends at t = {short_time(self.end_s)} s, but summary.json is of a run that ends at t = "
                          f"{short_time(end_s)} s: all numbers are from the log's samples, and whatever a log does not hold is "
                          "left out.")
        kept = {key: written[key] for key in _SAID_BEFORE_THE_RUN if key in written}
        return {**summary_from_log(self._run, self.log_path), **kept}

    def _black_box(self):
        """The black box, which a run that could not go on leaves in place of summary.json; {} if there is none."""
        for path in (self.folder / "blackbox.json", self.folder / "blackbox" / "blackbox.json"):
            if self.log_path.name == "run.lcmlog" and path.exists():
                return _mapping(path)
        return {}

    def _refuse_two_runs(self):
        for channel, messages in (("BALLAST_CONTACT", self._run.contact), ("BALLAST_PLANT_STATE", self._run.state)):
            back = np.flatnonzero(np.diff(messages["tick"]) <= 0)
            if len(back):
                before, after = messages["tick"][back[0]], messages["tick"][back[0] + 1]
                raise LogError(f"{self.log_path}: {channel} goes from tick {before} to tick {after}: more than one run "
                               "in a log, or a copy of its messages; allowed: one run")

    def _read_robot(self):
        """robot.json, or what the log shows of the robot: the ball's radius, without masses and rails."""
        path = self.folder / "robot.json"
        if path.exists():
            try:
                robot = _mapping(path)
                if len(robot["masses"]) == self.mass_count and float(robot["ball"]["radius"]) > 0:
                    return robot
                raise LogError(f"{path}: describes another robot than {self.log_path}")
            except (KeyError, TypeError, ValueError) as error:
                raise LogError(f"{path}: not what a run writes ({error!r})") from error
        radius = self._run.ball_radius_m()
        self.notes.append("There is no robot.json beside the log: the ball's radius is computed from its rolling, the "
                          "rails are drawn as far as the masses moved, and all masses have one size.")
        if radius is None:
            reach = np.linalg.norm(self._run.state["mass_position_B_m"], axis=2).max()
            radius = float(reach) / 0.9 if reach > 0 else 1.0
            self.notes[-1] += " It never rolls: the radius is a guess."
        return {"ball": {"radius": radius}, "masses": [{"mass": None, "rail": None}] * self.mass_count}

    def _columns(self):
        run = self._run
        _, rows_contact, rows_state = np.intersect1d(run.contact["tick"], run.state["tick"], return_indices=True)
        contact, state = run.contact[rows_contact], run.state[rows_state]
        if len(contact) == 0:
            raise LogError(f"{self.log_path}: no tick has both a BALLAST_CONTACT and a BALLAST_PLANT_STATE message")
        columns = {"time": np.array(contact["time_s"], dtype=float), "regime": contact["regime"],
                   "normal_force": contact["normal_force_n"], "static_friction": contact["static_friction_n"],
                   "mu_required": run.friction_required()[rows_contact],
                   "margin": np.where(contact["regime"] == ballast.contact_t.REGIME_FLIGHT, np.nan, contact["margin"])}
        if self.planned is not None and len(self.planned.path):
            columns["planned_mu_required"] = self.planned.need_at(columns["time"])
        for name in ("normal_force", "static_friction", "mu_required"):
            commanded = run.commanded(name + ("" if name == "mu_required" else "_n"))[rows_contact]
            if np.isfinite(commanded).any():
                columns[f"commanded_{name}"] = commanded
        if self.static_friction_under_ball is not None:
            holds = self.static_friction_under_ball[rows_state]
            columns["floor_friction"] = np.where(np.isfinite(holds), holds, np.nan)  # perfect: no line
        _add(columns, "friction_force", contact["friction_force_W_n"])
        _add(columns, "orientation", state["orientation"])
        _add(columns, "angular_velocity", state["angular_velocity_B_radps"])
        _add(columns, "position", state["position_W_m"])
        _add(columns, "center_of_mass", state["center_of_mass_B_m"])
        n = self.mass_count
        _add(columns, "mass_position", state["mass_position"][:, :n])
        _add(columns, "motor_torque", state["motor_torque_nm"][:, :n])
        _add(columns, "mass_B", state["mass_position_B_m"][:, :n].reshape(len(state), 3 * n))
        for motor in self.motors():
            columns[f"motor_margin_{motor.mass}"] = 100 * motor.margin[rows_state]
        self._add_commanded(columns, state)
        self._add_predicted(columns)
        self._add_known(columns)
        return columns

    def _add_predicted(self, columns):
        """Adds what the believed robot would have done; NaN after the end of the prediction."""
        found = self.predicted
        if found is None:
            return
        time = columns["time"]
        for name, values in (("normal_force", found.normal_n), ("static_friction", found.friction_n),
                             ("mu_required", found.need)):
            columns[f"believed_{name}"] = np.interp(time, found.time_s, values, right=np.nan)
        place = found.place_at(time)
        _add(columns, "believed_position", place)
        _add(columns, "believed_off", np.stack([columns[f"position_{j}"] for j in range(2)], axis=1) - place)

    def _add_known(self, columns):
        """Adds the estimate and the measured contact force with their bands; NaN where there is no status."""
        time = columns["time"]

        def add(name, at, values):
            rows = np.minimum(np.searchsorted(at, time), len(at) - 1)
            values = np.asarray(values, dtype=float)
            same = at[rows] == time
            values = np.where(same[:, None], values[rows], np.nan) if values.ndim > 1 else np.where(same, values[rows], np.nan)
            if values.ndim > 1:
                _add(columns, name, values)
            else:
                columns[name] = values

        if self.estimate is not None:
            found = self.estimate
            for name, track in (("tilt_error", found.tilt_deg), ("yaw_error", found.yaw_deg),
                                ("place_error", found.place_error_m)):
                add(name, found.time_s, track.error)
                add(f"{name}_sigma", found.time_s, track.sigma)
            add("gyro_bias", found.time_s, found.bias_degps.value)
            add("true_gyro_bias", found.time_s, found.bias_degps.truth)
            add("gyro_bias_sigma", found.time_s, found.bias_degps.sigma)
            add("estimated_position", found.time_s, found.place_m.value)
        if self.measured is not None:
            found = self.measured
            for name, short, track in (("normal_force", "normal", found.normal_n), ("mu_required", "mu", found.need)):
                add(f"measured_{name}", found.time_s, track.value[:, 0])
                add(f"measured_{name}_sigma", found.time_s, track.sigma)
                add(f"measured_{short}_error", found.time_s, track.error)
                columns[f"measured_{short}_error_sigma"] = columns[f"measured_{name}_sigma"]
            add("measured_slip", found.time_s, found.slip_mps2)
            add("measured_slip_sigma", found.time_s, found.slip_sigma_mps2)

    def _add_commanded(self, columns, state):
        """Adds commanded positions, NaN where there is no status: the last sample may lie between two tick starts."""
        if len(self._run.status) == 0 or self._run.status["motor_count"][0] == 0:
            return
        period_s = float(self.summary.get("control_period") or np.nan)
        status = self._run.status
        ticks, rows, rows_status = np.intersect1d(state["tick"], status["tick"], return_indices=True)
        at_start = np.abs(state["time_s"][rows] - ticks * period_s) < 1e-3 * period_s
        commanded = np.full((len(state), self.mass_count), np.nan)
        commanded[rows[at_start]] = status["commanded_position"][rows_status[at_start], :self.mass_count]
        if not np.isfinite(commanded).any():
            return
        if (status["governed"] != 0).any():
            # How far the governor went: 0 not at all, 1 it bent the command, 2 the masses were on the backup.
            levels = np.where(status["backup_active"] != 0, 2.0, (status["command_bent"] != 0).astype(float))
            governor = np.full(len(state), np.nan)
            governor[rows[at_start]] = levels[rows_status[at_start]]
            columns["governor"] = governor
        _add(columns, "commanded", commanded)
        _add(columns, "deviation", np.asarray(state["mass_position"][:, :self.mass_count]) - commanded)

    def _thin(self):
        time = self.columns["time"]
        if len(time) <= MOST_SAMPLES:
            return
        keep = thinned_rows([self.columns[name] for name in ("normal_force", "static_friction", "mu_required")],
                            MOST_SAMPLES)
        self.columns = {name: values[keep] for name, values in self.columns.items()}
        self.notes.append(f"{len(keep)} of {len(time)} samples are drawn, including the extremes. The numbers take all "
                          "samples into account.")


def _mapping(path):
    found = read_json(path)
    if not isinstance(found, dict):
        raise LogError(f"{path}: not a JSON object")
    return found


def _add(columns, name, values):
    for j in range(values.shape[1]):
        columns[f"{name}_{j}"] = values[:, j]


def thinned_rows(signals, most):
    """About `most` rows: of each of many equal blocks the first row and every signal's extremes; and the last row."""
    count = len(signals[0])
    stretch = -(-count * (1 + 2 * len(signals)) // most)
    keep = {count - 1}
    for start in range(0, count, stretch):
        keep.add(start)
        for values in signals:
            part = values[start:start + stretch]
            if np.isfinite(part).any():
                keep.update((start + int(np.nanargmin(part)), start + int(np.nanargmax(part))))
    return np.array(sorted(keep))


def summary_from_log(run, log_path):
    """The part of summary.json that a log shows."""
    state = run.state
    sound = np.isfinite(run.contact["normal_force_n"]) & np.isfinite(run.contact["static_friction_n"])
    if not sound.any():
        raise LogError(f"{log_path}: no contact message has a finite force")
    contact, all_ratios = run.contact[sound], run.friction_required()
    time = np.asarray(contact["time_s"], dtype=float)
    normal, friction, ratio = contact["normal_force_n"], contact["static_friction_n"], all_ratios[sound]
    least, most, strongest = int(np.argmin(normal)), int(np.argmax(normal)), int(np.argmax(friction))
    found = {"end": {"reason": None, "time": run.end_s},
             "normal_force": {"min": float(normal[least]), "min_time": time[least],
                              "max": float(normal[most]), "max_time": time[most]},
             "static_friction": {"max": float(friction[strongest]), "time": time[strongest]},
             "regimes": _regimes(run.contact, run.end_s), "trip": _trip(log_path)}
    in_contact = contact["regime"] != ballast.contact_t.REGIME_FLIGHT
    if in_contact.any():
        unbounded = in_contact & ~np.isfinite(ratio)
        row = int(np.argmax(unbounded)) if unbounded.any() else int(np.nanargmax(ratio))
        found["mu_required"] = {"max": None if unbounded.any() else float(ratio[row]), "time": time[row]}
    # margin = 1 - f_s / (mu_s N) (contact.lcm), so a margin of 1 with friction means perfect friction.
    shows = np.isfinite(ratio) & (ratio > 0) & (normal > 0)
    if shows.any():
        used = 1 - contact["margin"][shows]
        if (used == 0).all():
            found["surface"] = {"static_friction": None}
        elif (used > 0).all():
            found["surface"] = {"static_friction": float(np.median(ratio[shows] / used))}
    if len(contact) > 1:
        steps = np.diff(contact["utime"]) / np.diff(contact["tick"])
        found["control_period"] = float(np.median(steps)) * 1e-6
    found["actuation"] = "stepper" if len(run.status) else "prescribed"
    count = run.mass_count
    found["final"] = {"mass_position": [float(v) for v in state["mass_position"][-1][:count]],
                      "orientation": [float(v) for v in state["orientation"][-1]],
                      "angular_velocity": [float(v) for v in state["angular_velocity_B_radps"][-1]],
                      "position": [float(v) for v in state["position_W_m"][-1]]}
    return found


def _regimes(contact, end_s):
    starts = np.concatenate([[0], np.flatnonzero(np.diff(contact["regime"])) + 1])
    times = [float(contact["time_s"][row]) for row in starts] + [end_s]
    return [{"regime": REGIME_NAMES.get(int(contact["regime"][row]), "unknown"), "start": times[k], "end": times[k + 1]}
            for k, row in enumerate(starts)]


def _trip(log_path):
    trips = EventLog(log_path, ["BALLAST_TRIP"]).messages("BALLAST_TRIP", ballast.trip_t)
    tripped = trips[trips["tripped"] != 0]
    if len(tripped) == 0:
        return None
    first = tripped[0]
    finite = {name: float(first[name]) if math.isfinite(first[name]) else None for name in ("value", "limit")}
    return {"cause": _TRIP_CAUSES.get(int(first["cause"]), "unknown"), "time": float(first["trip_time_s"]),
            "tick": int(first["trip_tick"]), **finite, "latency_ticks": None}
