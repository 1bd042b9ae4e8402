"""Checks the shape of a summary.json before it is used. A file that no run has written is refused."""

import json

from event_log import LogError


def _number(value):
    # Python's JSON reader accepts true as a number, NaN, infinity and integers beyond the range of a double.
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -1.7e308 <= value <= 1.7e308


def _text(value):
    return isinstance(value, str)


def _flag(value):
    return isinstance(value, bool)


_NAMES = {_number: "a number", _text: "a text", _flag: "true or false"}


class _OrNull:
    """null, or a value of this shape."""

    def __init__(self, shape):
        self.shape = shape


_MAYBE = _OrNull(_number)
_PLAN = {"start!": _number, "duration!": _number, "predicted_normal_force_min": _MAYBE,
         "predicted_mu_required_max": _MAYBE, "predicted_margin_min": _MAYBE, "margin_min": _MAYBE}
_TRIP = {"cause!": _text, "time!": _number, "value": _MAYBE, "limit": _MAYBE}
# The keys that the pictures and reports use. A key that ends in ! is required; the others are optional.
_SHAPE = {
    "actuation": _OrNull(_text),
    "control_period": _MAYBE,
    "end": {"reason": _OrNull(_text), "time": _number},
    "mu_required": {"max": _MAYBE, "time!": _number},
    "normal_force": {"min": _MAYBE, "min_time": _number, "max": _MAYBE, "max_time": _number},
    "static_friction": {"max": _MAYBE, "time": _number},
    "surface": {"static_friction": _MAYBE},
    "envelope": _OrNull({}),
    "motor_share": _OrNull({name: _OrNull({}) for name in ("normal_force", "static_friction", "mu_required")}),
    "regimes": [{"regime!": _text, "start!": _number, "end!": _number}],
    "impacts": [{"time!": _number, "normal_impulse": _number, "friction_impulse": _number, "sticking": _flag}],
    "trip": _OrNull({**_TRIP, "latency_ticks": _MAYBE, "monitor": _TRIP}),
    "estimate": _OrNull({name: _MAYBE for name in ("tilt_rms", "position_rms", "friction_rms", "gyro_bias_error")}),
    "belief": {"time!": _number, "holds!": _flag, "mu_required!": {"max!": _MAYBE},
               "normal_force!": {"min!": _number}, "position_error!": _number},
    "move": _OrNull(_PLAN),
    "stop": _OrNull(_PLAN),
    "faults": [{}],
    "required_friction": _OrNull({"text": _OrNull(_text)}),
    "motors": [_OrNull({"steps": _number, "lost_steps": _number, "max_step_rate": _number, "max_torque": _number,
                    "torque_margin!": _number,
                    "parameters": {name: _number for name in (
                        "shaft_ratio", "steps_per_revolution", "holding_torque", "detent_torque", "viscous_damping",
                        "corner_speed")} | {name: _MAYBE for name in (
                            "rated_current", "supply_voltage", "resistance", "inductance")}})],
    "surfaces": [{"name!": _text, "mu_s!": _number, "holds!": _flag}],
    "published": [{"quantity!": _text, "published!": _number, "here": _MAYBE}],
}


def check_summary(summary, path):
    """Raises LogError with file, key and allowed shape if a key in use has another shape."""
    _check(summary, _SHAPE, path, "")


def _check(value, shape, path, place):
    if isinstance(shape, _OrNull):
        if value is not None:
            _check(value, shape.shape, path, place)
    elif isinstance(shape, dict):
        if not isinstance(value, dict):
            _refuse(path, place, value, "an object")
        for key, inner in shape.items():
            name = key.rstrip("!")
            inside = f"{place}.{name}" if place else name
            if name in value:
                _check(value[name], inner, path, inside)
            elif key != name:
                raise LogError(f"{path}: {inside} is missing")
    elif isinstance(shape, list):
        if not isinstance(value, list):
            _refuse(path, place, value, "a list")
        for i, entry in enumerate(value):
            _check(entry, shape[0], path, f"{place}.{i}")
    elif not shape(value):
        _refuse(path, place, value, _NAMES[shape])


def _refuse(path, place, value, allowed):
    raise LogError(f"{path}: {place + ' ' if place else ''}is {json.dumps(value)[:40]}; allowed: {allowed}")
