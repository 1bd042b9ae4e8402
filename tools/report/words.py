"""A run's summary as sentences and tables. They are plain text; the caller escapes them for HTML."""

import json
import math
from typing import NamedTuple

import numpy as np

from short_number import apart, short_number, short_time

_CAUSES = {
    "normal_force": "the normal force N came down to its limit",
    "friction": "the friction came up to its limit",
    "nonfinite": "a value was not finite",
    "stale": "messages were overdue",
    "missing": "a message was missing",
    "repeated": "a message came twice",
    "disagreement": "plant and controller disagree about the contact force",
    "slip_measured": "the robot measured slip",
    "light_measured": "the robot measured too small a normal force",
    "no_estimate": "the robot lost its estimate",
}
# reason: (badge, whether that is good)
_BADGES = {
    "completed": ("Held", True),
    "slipped": ("Slipped", False),
    "detached": ("Left the ground", False),
    "tripped": ("Tripped", False),
    "inconsistent": ("No consistent force", False),
    "step_timing": ("Step mistimed", False),
}


def number_text(value):
    """Three digits, as in the terminal. None stands for infinity, which JSON lacks."""
    return "unbounded" if value is None else short_number(value)


def time_text(value):
    return f"t\u00a0=\u00a0{short_time(value)}\u00a0s"  # does not break over lines


def cause_text(cause):
    return _CAUSES.get(cause, str(cause).replace("_", " "))


def badge(recording):
    """(text, "good", "bad" or "unknown") for how the run ended."""
    summary = recording.summary
    reason = (summary.get("end") or {}).get("reason")
    if reason is None:
        return ("Tripped", "bad") if summary.get("trip") else ("End not recorded", "unknown")
    text, good = _BADGES.get(reason, (str(reason), False))
    if good and _left_rolling(summary):
        return "Rolling was lost", "bad"
    if good and any(regime["regime"] != "rolling" for regime in summary.get("regimes", [])):
        text = "Completed"
    if good and summary.get("trip"):
        return "Tripped", "bad"
    return text, "good" if good else "bad"


def _left_rolling(summary):
    """True if the ball rolled and later did not. A run that starts sliding or in flight has to roll first."""
    names = [regime["regime"] for regime in summary.get("regimes", [])]
    return "rolling" in names and any(name != "rolling" for name in names[names.index("rolling"):])


def sentences(recording):
    summary = recording.summary
    found = [_what_it_was(recording), _how_it_ended(summary), _envelope(recording)]
    found += [_faults(summary), _trip(recording), _motors(summary), _required_friction(summary) or _floors(summary)]
    return [sentence for sentence in found if sentence]


def mass_name(i):
    """Masses count from 0, as on the command line and in scenarios."""
    return f"mass {i}"


def _count(number, one, many=None):
    return f"{number} {one if number == 1 else many or one + 's'}"


def _what_it_was(recording):
    summary = recording.summary
    masses = ("no moving mass" if recording.mass_count == 0 else
              f"{_count(recording.mass_count, 'mass', 'masses')} moved by stepper motors"
              if summary.get("actuation") == "stepper" else
              f"{_count(recording.mass_count, 'mass', 'masses')} moved exactly as "
              f"{'commanded' if summary.get('actuation') == 'ideal' else 'prescribed'}")
    radius = number_text(recording.robot["ball"]["radius"])
    return f"A ball of radius {radius} m with {masses}, followed for {short_time(recording.end_s)} s."


def _how_it_ended(summary):
    end = summary.get("end") or {}
    reason, time = end.get("reason"), end.get("time")
    regimes = summary.get("regimes", [])
    names = {regime["regime"] for regime in regimes}
    if reason is None:
        ended = f"The log ends at {time_text(time)}."
    elif reason == "completed":
        ended = ("It rolled without slipping to the end and never left the ground." if names == {"rolling"} else
                 f"The run completed at {time_text(time)}.")
    elif reason == "slipped":
        ended = f"Rolling ended at {time_text(time)}: the friction it needed reached the floor's limit."
    elif reason == "detached":
        ended = f"At {time_text(time)} N fell to 0: the ball left the floor."
    elif reason == "tripped":
        rest = "at rest" if end.get("masses_at_rest") else "still swinging in their motors"
        ended = f"It stopped after a trip and ended at {time_text(time)} with the masses {rest}."
    elif reason == "inconsistent":
        ended = f"The simulation ended at {time_text(time)}: {end.get('text', 'no consistent contact force')}."
    else:
        ended = f"It ended at {time_text(time)}: {str(reason).replace('_', ' ')}."
    if names - {"rolling"}:
        phases = [_count(sum(regime["regime"] == name for regime in regimes), f"phase of {name}", f"phases of {name}")
                  for name in ("rolling", "sliding", "flight") if name in names]
        ended += " There were " + ", ".join(phases)
        impacts = len(summary.get("impacts") or [])
        ended += f", and {_count(impacts, 'impact')}." if impacts else "."
    return ended


def _mu_text(value):
    return "perfect" if math.isinf(value) else number_text(value)


def _envelope(recording):
    summary = recording.summary
    normal, needed = summary.get("normal_force"), summary.get("mu_required")
    words = ""
    if normal and normal.get("min") is not None:
        words = f"The least normal force was {number_text(normal['min'])} N, at {time_text(normal['min_time'])}. "
    if not needed:
        return words
    if needed.get("max") is None:
        return words + f"At {time_text(needed['time'])} it was 0 in contact, where no friction is enough."
    limit = recording.static_friction_coefficient
    words += f"The most friction it needed, f_s/N, was {number_text(needed['max'])}, at {time_text(needed['time'])}"
    if limit is None:
        return words + "."
    if recording.static_friction_under_ball is not None:
        holds, worst = recording.static_friction_under(needed["time"]), recording.scarcest_friction(needed["time"])
        words += f", where the floor's mu_s was {_mu_text(holds)}"
        return words + (f"; {worst}." if worst else ".")
    if math.isinf(limit):
        return words + "; this floor's friction is perfect."
    return words + f": {100 * needed['max'] / limit:.0f} % of this floor's {number_text(limit)}."


def _required_friction(summary):
    """The verdict of `ballast friction`: where the required friction comes from and on which floors the ball holds."""
    text = (summary.get("required_friction") or {}).get("text")
    return f"In short: {text}." if text else ""


def fault_words(fault):
    """(kind, text of all further keys) of one of `faults`."""
    kind = str(fault.get("kind", "fault")).replace("_", " ")
    parts = [f"{str(key).replace('_', ' ')} {_value_words(value)}" for key, value in fault.items()
            if key not in ("kind", "time") and value is not None]
    return kind, ", ".join(parts)


def _value_words(value):
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return number_text(value)
    return value if isinstance(value, str) else json.dumps(value)


def _faults(summary):
    parts = []
    for fault in summary.get("faults") or []:
        kind, more = fault_words(fault)
        when = f" at {time_text(fault['time'])}" if _is_number(fault.get("time")) else ""
        reached = not when or fault["time"] <= summary.get("end", {}).get("time", math.inf)
        parts.append(kind + when + (f" ({more})" if more else "") + ("" if reached else ", after the run's end"))
    return f"Injected faults: {'; '.join(parts)}." if parts else ""


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _slid(trip):
    """Whether the ball slid on less friction than its floor was to have."""
    return trip.get("cause") == "friction" and None not in (trip.get("value"), trip.get("limit")) \
        and trip["value"] <= trip["limit"]


def _friction_trip(recording, trip):
    """Value and limit of a trip on friction, in the words of `ballast run`."""
    value_text, limit_text = apart(trip["value"], trip["limit"])
    if trip["value"] > trip["limit"]:
        return f", {value_text} where {limit_text} is the limit"
    holds = recording.static_friction_under(trip["time"])
    where = "" if holds is None or math.isinf(holds) else f" (mu_s = {number_text(holds)} where it was)"
    return f": the ball slid at f_s/N = {value_text}, on a floor that was to hold up to {limit_text}{where}"


def _violation(recording, trip):
    """Time, cause and values of a trip."""
    value, limit = trip.get("value"), trip.get("limit")
    known = value is not None and limit is not None
    words = f"{time_text(trip['time'])}: {'friction' if _slid(trip) else cause_text(trip.get('cause'))}"
    if known and trip.get("cause") == "friction":
        return words + _friction_trip(recording, trip)
    if known and trip.get("cause") == "normal_force":
        value_text, limit_text = apart(value, limit)
        return words + f", {value_text} where {limit_text} is the limit"
    return words


def _trip(recording):
    summary = recording.summary
    trip = summary.get("trip")
    if not trip:
        return "" if summary.get("end", {}).get("reason") is None else "Nothing tripped."
    words = "Tripped at " + _violation(recording, trip)
    if trip.get("monitor"):  # after the controller itself
        words += "; then the monitor tripped at " + _violation(recording, trip["monitor"])
    latency = trip.get("latency_ticks")
    stops = latency is not None and summary.get("actuation") != "prescribed"
    return words + (f"; the stop began {_count(latency, 'tick')} later." if stops else ".")


def _motors(summary):
    motors = [motor for motor in summary.get("motors") or [] if motor]
    if not motors:
        return ""
    margin = min(motor["torque_margin"] for motor in motors)
    words = (f"At least {100 * margin:.0f} % of the motors' torque stayed unused" if margin >= 0 else
             "The motors had less torque than was needed")
    if summary.get("actuation") != "stepper":
        return words + "."
    lost = sum(motor["lost_steps"] for motor in motors)
    return words + (f"; {_count(lost, 'microstep')} {'was' if lost == 1 else 'were'} lost." if lost else
                    "; no step was lost.")


def _floors(summary):
    floors = summary.get("surfaces") or []
    holds = [floor["name"] for floor in floors if floor["holds"]]
    fails = [floor["name"] for floor in floors if not floor["holds"]]
    if not floors:
        return ""
    if not holds:
        return "It would not have held on any of the paper's floors."
    return f"It would have held on {', '.join(holds)}" + (f"; not on {', '.join(fails)}." if fails else ".")


class Number(NamedTuple):
    """One number of the summary. `path` is its place in summary.json, or a name of its own."""

    label: str
    path: str
    value: float | None
    unit: str
    when: float | None = None

    @property
    def factor(self):
        """From the summary's unit to this one: margins are fractions there, and angles rad."""
        return {"%": 100, "\u00b0": math.degrees(1)}.get(self.unit, 1)

    @property
    def text(self):
        """The value in its unit."""
        return number_text(None if self.value is None else self.factor * self.value)


def numbers(recording):
    """The numbers at the top of the page."""
    summary = recording.summary
    found = []

    def add(label, section, key, unit, when_key=None):
        entry = summary.get(section) or {}
        if key in entry:
            found.append(Number(label, f"{section}.{key}", entry[key], unit, entry.get(when_key)))

    add("least normal force", "normal_force", "min", "N", "min_time")
    add("most normal force", "normal_force", "max", "N", "max_time")
    add("most friction f_s", "static_friction", "max", "N", "time")
    add("needed: most f_s/N", "mu_required", "max", "", "time")
    under = recording.static_friction_under_ball
    add("the floor's mu_s" if under is None else "mu_s beside patches", "surface", "static_friction", "")
    if under is not None:
        row = int(np.argmin(under))
        found.append(Number("least mu_s under the ball", "under_ball.static_friction", float(under[row]), "",
                            float(recording.under_ball_time_s[row])))
    add("end", "end", "time", "s")
    motors = [(motor["torque_margin"], i) for i, motor in enumerate(summary.get("motors") or []) if motor]
    if motors:
        margin, i = min(motors)
        found.append(Number(f"least torque margin, {mass_name(i)}", f"motors.{i}.torque_margin", margin, "%"))
    known = summary.get("estimate") or {}
    for label, key, unit in (("tilt error, rms", "tilt_rms", "\u00b0"), ("place error, rms", "position_rms", "m"),
                             ("error of measured f_s/N, rms", "friction_rms", "")):
        if known.get(key) is not None:
            add(label, "estimate", key, unit)
    return found


def _maybe_text(value):
    return "–" if value is None else number_text(value)


class Table(NamedTuple):
    title: str
    head: list
    rows: list


def tables(recording):
    """The tables below the plots, one per list of the summary."""
    summary, found = recording.summary, []
    motors = summary.get("motors") or []
    if any(motors):
        head = ["mass", "weighs [kg]", "steps", "lost", "greatest rate [1/s]", "greatest torque [N m]", "least margin"]
        rows = []
        for i, motor in enumerate(motors):
            weight = recording.robot["masses"][i]["mass"]
            weight = "–" if weight is None else number_text(weight)
            rows.append([str(i), weight] + (["on a trajectory"] + [""] * 4 if motor is None else
                        [str(motor["steps"]), str(motor["lost_steps"]), number_text(motor["max_step_rate"]),
                         number_text(motor["max_torque"]), f"{short_number(100 * motor['torque_margin'])} %"]))
        found.append(Table("Motors", head, rows))
    if summary.get("surfaces"):
        found.append(Table("The paper's floors", ["floor", "mu_s", "this run holds"],
                           [[floor["name"], number_text(floor["mu_s"]), "yes" if floor["holds"] else "no"]
                            for floor in summary["surfaces"]]))
    regimes = summary.get("regimes") or []
    if len(regimes) > 1 or any(regime["regime"] != "rolling" for regime in regimes):
        found.append(Table("Regimes", ["regime", "from [s]", "to [s]"],
                           [[regime["regime"], number_text(regime["start"]), number_text(regime["end"])]
                            for regime in regimes]))
    if summary.get("impacts"):
        found.append(Table("Impacts", ["t [s]", "normal impulse [N s]", "friction impulse [N s]", ""],
                           [[number_text(impact["time"]), number_text(impact["normal_impulse"]),
                             number_text(impact["friction_impulse"]), "sticks" if impact["sticking"] else "slips"]
                            for impact in summary["impacts"]]))
    plans = [(name, summary[name]) for name in ("move", "stop") if summary.get(name)]
    if plans:
        found.append(Table("Moves and stops", ["last", "from [s]", "takes [s]", "least N predicted [N]",
                                               "most f_s/N predicted", "least margin predicted", "least margin true"],
                           [[name, number_text(plan["start"]), number_text(plan["duration"])] +
                            [_maybe_text(plan.get(key)) for key in (
                                "predicted_normal_force_min", "predicted_mu_required_max", "predicted_margin_min",
                                "margin_min")] for name, plan in plans]))
    if summary.get("faults"):
        rows = []
        for fault in summary["faults"]:
            kind, more = fault_words(fault)
            rows.append([kind, number_text(fault["time"]) if _is_number(fault.get("time")) else "–", more])
        found.append(Table("Injected faults", ["kind", "t [s]", "parameters"], rows))
    if summary.get("published"):
        found.append(Table("Published", ["quantity", "published", "here", "by"],
                           [[str(p["quantity"]), number_text(p["published"]), number_text(p.get("here")),
                             str(p.get("source", ""))] for p in summary["published"]]))
    return found


def events(recording):
    """(time, text) of each mark in the plots: faults, the trip, and an early end."""
    summary, found = recording.summary, []
    trip, end = summary.get("trip"), summary.get("end") or {}
    for fault in summary.get("faults") or []:
        if _is_number(fault.get("time")):
            found.append((fault["time"], f"fault: {fault_words(fault)[0]}"))
    for what, text in (("slip", "the robot flags slip"), ("light", "the robot flags light contact")):
        flags = [flag for flag in (recording.measured.flags if recording.measured else []) if flag.what == what]
        if flags:
            more = f", the first of {len(flags)} times" if len(flags) > 1 else ""
            found.append((flags[0].start_s, text + more))
    for one in (trip, (trip or {}).get("monitor")):
        if one and one.get("time") is not None:
            found.append((one["time"], f"trip: {'the ball slid' if _slid(one) else cause_text(one.get('cause'))}"))
    what = {"slipped": "the ball slips", "detached": "the ball leaves the ground",
            "inconsistent": "no consistent contact force", "step_timing": "a step mistimed"}.get(end.get("reason"))
    if what:
        found.append((end["time"], what))
    return sorted(found)
