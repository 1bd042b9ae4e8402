"""Writes run folders as `ballast run` does, from the reference runs in tests/data, with lcm-gen's own encoders."""

import csv
import json
import math
import struct
from pathlib import Path

import ballast
import numpy as np

DATA = Path(__file__).resolve().parent.parent / "data"

# The circles of the paper's ball: per mass the radius, n and -b1 (Frisvad) of its direction, which go with cos and sin.
_HALF, _ROOT = 0.5, math.sqrt(0.5)
_A = 1 / (1 + _ROOT)
BALL_RAILS = [
    (0.95, (1, 0, 0), (0, 0, 1)),
    (0.90, (0, 1, 0), (-1, 0, 0)),
    (0.85, (_HALF, _HALF, _ROOT), (-(1 - _HALF**2 * _A), _HALF**2 * _A, _HALF)),
]
DISK_RAILS = [(radius, (1, 0, 0), (0, 0, 1)) for radius in (0.9, 0.9 - 0.8 / 3, 0.9 - 1.6 / 3, 0.1)]


# Its corner speed lies below the shaft's, 3 * 0.15 rad/s, so that there less than the holding torque is available.
MOTOR = {"shaft_ratio": 3.0, "steps_per_revolution": 200, "holding_torque": 4.0, "detent_torque": 0.25,
         "viscous_damping": 0.5, "corner_speed": 0.3}


def motor_torque_nm(i, time_s):
    """Motor i in the log: it has nothing to do with the masses' motion."""
    return 0.5 * (i + 1) * math.sin(time_s)


def commanded_forces(contact, time_s):
    """N and f_s that the log says of the commanded masses: off the real ones by what the motors shake."""
    shake = 0.125 * math.sin(9 * time_s)
    return max(contact.normal_force_n + shake, 0.0), contact.static_friction_n + abs(shake) / 2


# The estimate in the log, with known = True. Angles in degrees; errors are the estimate less the truth.
GYRO_BIAS_DEGPS = np.array([0.5, -0.25, 0.125])
KNOWN_SIGMA = {"tilt": 0.25, "yaw": 2.0, "bias": 0.1, "place": 0.05, "normal": 0.5, "need": 0.01, "slip": 0.2}
SLIP_FLAGS = ((5.0, 6.0), (9.0, 9.5))
LIGHT_FLAGS = ((12.0, 12.25),)


def tilt_error_deg(time_s):
    return np.array([0.2 * math.sin(time_s), 0.1 * math.cos(2 * time_s)])


def yaw_error_deg(time_s):
    return 0.3 * time_s


def bias_error_degps(time_s):
    return np.array([0.05, -0.02, 0.01]) * math.exp(-time_s / 5)


def place_error_m(time_s):
    return np.array([0.004, -0.002]) * time_s


def measured_error(time_s):
    """Errors of N and of f_s / N."""
    return 0.25 * math.sin(7 * time_s), 0.005 * math.sin(11 * time_s)


def quaternion(turn_rad):
    """The unit quaternion w, x, y, z of a turn vector."""
    angle = float(np.linalg.norm(turn_rad))
    return np.append(math.cos(angle / 2), np.sinc(angle / 2 / math.pi) / 2 * np.asarray(turn_rad, dtype=float))


def quaternion_product(p, q):
    return np.append(p[0] * q[0] - p[1:] @ q[1:], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))


def set_known(status, contact, state):
    """Fills the fields of estimate and measured contact: the truth, turned and moved by the errors above."""
    time = state.time_s
    yaw, tilt = (quaternion(np.radians(turn)) for turn in ((0, 0, yaw_error_deg(time)), (*tilt_error_deg(time), 0)))
    # Tilted first, then turned about e3, so that the errors are those of gravity and heading whatever their size.
    status.estimated_orientation = list(quaternion_product(quaternion_product(tilt, yaw), np.array(state.orientation)))
    status.estimate_valid = status.measured_valid = 1
    status.estimated_angular_velocity_B_radps = list(state.angular_velocity_B_radps)
    status.estimated_gyro_bias_B_radps = list(np.radians(GYRO_BIAS_DEGPS + bias_error_degps(time)))
    status.estimated_position_W_m = list(np.array(state.position_W_m[:2]) + place_error_m(time))
    status.tilt_sigma_rad, status.yaw_sigma_rad = math.radians(KNOWN_SIGMA["tilt"]), math.radians(KNOWN_SIGMA["yaw"])
    status.gyro_bias_sigma_radps, status.position_sigma_m = math.radians(KNOWN_SIGMA["bias"]), KNOWN_SIGMA["place"]
    of_normal, of_need = measured_error(time)
    status.measured_normal_force_n, status.measured_normal_sigma_n = contact.normal_force_n + of_normal, KNOWN_SIGMA["normal"]
    status.measured_mu_required, status.measured_mu_sigma = contact.mu_required + of_need, KNOWN_SIGMA["need"]
    status.measured_slip_mps2, status.measured_slip_sigma_mps2 = 0.1 + 0.05 * math.sin(time), KNOWN_SIGMA["slip"]
    status.slip_detected = int(any(start <= time < end for start, end in SLIP_FLAGS))
    status.light_detected = int(any(start <= time < end for start, end in LIGHT_FLAGS))


BELIEF_HEAD = "time_s,position_1_m,position_2_m,normal_force_n,static_friction_n,mu_required"


def believe(run, folder):
    """Writes belief.csv, of a robot that has a tenth more N and ends elsewhere, and the summary's `belief`."""
    folder.mkdir(parents=True, exist_ok=True)
    table = read_reference("paper_ball")
    rows = [BELIEF_HEAD]
    for k in range(0, len(table["t"]), 10):
        normal, friction = 1.1 * table["N"][k], math.hypot(table["f_1"][k], table["f_2"][k])
        rows.append(f"{table['t'][k]},{0.9 * table['z_1'][k]},{table['z_2'][k]},{normal},{friction},{friction / normal}")
    (folder / "belief.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    run.summary["belief"] = {"time": 20.0, "holds": True, "mu_required": {"max": 0.17, "time": 6.4},
                             "normal_force": {"min": 30.0, "min_time": 3.0},
                             "static_friction": {"max": 6.0, "time": 6.4}, "position": [1.0, 2.0, 0.0],
                             "position_error": 0.5}
    return run


def event(number, utime, channel, data):
    """One event of an LCM event log."""
    return struct.pack(">Iqqii", 0xEDA1DA01, number, utime, len(channel), len(data)) + channel.encode() + data


def read_reference(name):
    """Column name -> array."""
    with open(DATA / f"{name}.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


class SyntheticRun:
    """The reference run, resampled linearly to control ticks. Change `summary` or `events` before write()."""

    def __init__(self, reference, rails, mass_kg, period_s=0.1, controller=False, turn_rad=0.0, known=False,
                 imu_every=1, imu_late=0):
        """`turn_rad` turns the path about the vertical; `known`: with an estimate and a measured contact force, and with
        a sample of the IMU in every so many ticks, which arrives so many ticks late."""
        table = read_reference(reference)
        end = table["t"][-1]
        count = int(math.floor(end / period_s + 1e-9)) + 1
        times = np.arange(count) * period_s
        if end - times[-1] > 1e-9:
            times = np.append(times, end)
        col = {key: np.interp(times, table["t"], values) for key, values in table.items()}
        cos, sin = math.cos(turn_rad), math.sin(turn_rad)
        n = len(rails)
        self.events = []
        rates = {}
        for tick in range(-2, len(times)):
            k = max(tick, 0)
            time = times[k]
            utime = round(1e6 * (tick * period_s if tick < 0 else time))
            force = [cos * col["f_1"][k] - sin * col["f_2"][k], sin * col["f_1"][k] + cos * col["f_2"][k]]
            contact = ballast.contact_t()
            contact.tick, contact.utime, contact.time_s = tick, utime, float(time)
            contact.commanded_tick = tick
            contact.normal_force_n = float(col["N"][k])
            contact.static_friction_n = math.hypot(*force)
            contact.friction_force_W_n = force
            in_contact = contact.normal_force_n > 0
            contact.mu_required = contact.static_friction_n / contact.normal_force_n if in_contact else math.inf
            if controller and tick >= 0 and abs(time - tick * period_s) < 1e-9:
                contact.commanded_normal_force_n, contact.commanded_static_friction_n = commanded_forces(contact, time)
                contact.commanded_mu_required = (contact.commanded_static_friction_n / contact.commanded_normal_force_n
                                                 if contact.commanded_normal_force_n > 0 else math.inf)
            else:
                contact.commanded_normal_force_n = contact.commanded_static_friction_n = math.nan
                contact.commanded_mu_required = math.nan
            contact.last = int(k == len(times) - 1)
            state = ballast.plant_state_t()
            state.tick, state.utime, state.time_s = tick, utime, float(time)
            q = np.array([col[key][k] for key in ("q_w", "q_x", "q_y", "q_z")])
            state.orientation = list(q / np.linalg.norm(q))
            state.angular_velocity_B_radps = [col[f"Omega_{j}"][k] for j in (1, 2, 3)]
            z = [cos * col["z_1"][k] - sin * col["z_2"][k], sin * col["z_1"][k] + cos * col["z_2"][k]]
            state.position_W_m = [*z, 0.0]
            state.velocity_W_mps = _rolling_velocity(state.orientation, state.angular_velocity_B_radps, 1.0, cos, sin)
            state.mass_count = n
            for i, (radius, axis_cos, axis_sin) in enumerate(rails):
                theta = col[f"theta_{i + 1}"][k]
                state.mass_position[i] = theta
                state.mass_velocity[i] = col[f"theta_dot_{i + 1}"][k]
                state.motor_torque_nm[i] = motor_torque_nm(i, time)
                around = math.cos(theta) * np.array(axis_cos) + math.sin(theta) * np.array(axis_sin)
                state.mass_position_B_m[i] = list(radius * around)
            moment = np.array(mass_kg) @ np.array(state.mass_position_B_m[:n])
            state.center_of_mass_B_m = list(moment / (1 + sum(mass_kg)))  # the shell: 1 kg, balanced
            state.last = contact.last
            self._add(utime, "BALLAST_CONTACT", contact)
            self._add(utime, "BALLAST_PLANT_STATE", state)
            if known:
                rates[tick] = state.angular_velocity_B_radps
                taken = (tick - imu_late) // imu_every * imu_every
                self._add_gyro(tick, utime, taken, rates.get(taken), taken // imu_every + 3)
            if controller or known:
                status = ballast.controller_status_t()
                status.tick, status.utime, status.motor_count = tick, utime, n
                for i in range(n):
                    # A rotor that lags its command a little and swings about it.
                    status.commanded_position[i] = state.mass_position[i] + 2e-3 * (i + 1) * math.sin(5 * time + i)
                if known and tick >= 0:
                    set_known(status, contact, state)
                self._add(utime, "BALLAST_CONTROLLER_STATUS", status)
        normal, friction = col["N"], np.hypot(col["f_1"], col["f_2"])
        ratio = friction / np.where(normal > 0, normal, np.nan)
        most, least, strongest = int(np.nanargmax(ratio)), int(np.argmin(normal)), int(np.argmax(friction))
        self.summary = {
            "scenario": reference.replace("_", "-"),
            "actuation": "stepper" if controller else "prescribed",
            "end": {"reason": "completed", "time": float(end)},
            "mu_required": {"max": float(ratio[most]), "time": float(times[most])},
            "normal_force": {"min": float(normal[least]), "min_time": float(times[least])},
            "static_friction": {"max": float(friction[strongest]), "time": float(times[strongest])},
            "regimes": [{"regime": "rolling", "start": 0.0, "end": float(end)}],
            "impacts": [],
            "trip": None,
            "surface": {"static_friction": 0.35, "kinetic_friction": 0.3},
            "motors": [{"steps": 0, "lost_steps": 0, "max_step_rate": 0.0, "max_torque": 1.25 + i,
                        "torque_margin": 0.5 - 0.125 * i, "parameters": dict(MOTOR)} for i in range(n)],
            "published": [],
            "duration": 20.0,
            "control_period": period_s,
        }

    def _add_gyro(self, tick, utime, taken, rate_radps, count):
        sensors = ballast.sensors_t()
        sensors.tick, sensors.utime = tick, utime
        if rate_radps is not None:
            sensors.imu_tick, sensors.imu_count = taken, count
            sensors.gyro_B_radps = list(np.array(rate_radps) + np.radians(GYRO_BIAS_DEGPS))
        self._add(utime, "BALLAST_SENSORS", sensors)

    def _add(self, utime, channel, message):
        self.events.append(event(len(self.events), utime, channel, message.encode()))

    def write(self, folder):
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "summary.json").write_text(json.dumps(self.summary), encoding="utf-8")
        (folder / "run.lcmlog").write_bytes(b"".join(self.events))
        return folder


def ball(**options):
    run = SyntheticRun("paper_ball", BALL_RAILS, (1, 1, 1), **options)
    run.summary["published"] = [{"quantity": "mu_required.max", "published": 0.19}]
    return run


def disk(**options):
    run = SyntheticRun("paper_disk", DISK_RAILS, (1, 1, 1, 1), **options)
    run.summary["published"] = [{"quantity": "mu_required.max", "published": 0.2951}]
    return run


def detaching_ball(**options):
    run = SyntheticRun("paper_detach", BALL_RAILS, (0.1, 0.1, 60), **options)
    end = run.summary["end"]["time"]
    run.summary["end"]["reason"] = "detached"
    run.summary["mu_required"] = {"max": None, "time": end}
    run.summary["trip"] = {"cause": "normal_force", "time": end, "value": 0.0, "limit": 0.0, "latency_ticks": 1}
    run.summary["surface"] = {"static_friction": None, "kinetic_friction": None}
    run.summary["published"] = [{"quantity": "end.time", "published": 3.7358}]
    return run


def _rolling_velocity(orientation, rate_B, radius, cos, sin):
    """zdot = omega x r e3, in a space frame turned about the vertical."""
    w, x, y, z = orientation
    body_to_space = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])
    rate_W = body_to_space @ np.array(rate_B)
    velocity = radius * np.array([rate_W[1], -rate_W[0]])
    return [cos * velocity[0] - sin * velocity[1], sin * velocity[0] + cos * velocity[1], 0.0]
