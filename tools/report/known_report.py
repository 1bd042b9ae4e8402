"""What the robot knew, as the report shows it beside its plots: sentences, tables, and the floor from above with the
true, the estimated and the believed path."""

import math

import numpy as np

import words
from floor_map import FloorMap, key, thinned
from known import BAND_NAME, BAND_SIGMAS

_CIRCLES = 150  # of the band along a path


def _share(value):
    return "–" if not np.isfinite(value) else f"{100 * value:.0f} %"


def _length(metres):
    return f"{1e3 * metres:.3g} mm" if metres < 0.01 else f"{metres:.3g} m"


def tracks(recording):
    """(name, id of the plot, known.Track, unit) of each quantity that the robot estimates or measures, and whose truth the
    messages have: the gyro's bias is none."""
    found = []
    if recording.estimate is not None:
        e = recording.estimate
        found += [("tilt", "tilt_error", e.tilt_deg, "°"), ("yaw", "yaw_error", e.yaw_deg, "°"),
                  ("place", "place_error", e.place_m, "m")]
    if recording.measured is not None:
        found += [("measured f_s/N", "measured_mu_error", recording.measured.need, ""),
                  ("measured N", "measured_normal_error", recording.measured.normal_n, "N")]
    return found


def plot_notes(recording):
    """A short text for the title of each plot with a band, by the plot's id."""
    notes = {plot: f"band {BAND_NAME}, {_share(track.inside())} inside" for _, plot, track, _ in tracks(recording)}
    if recording.estimate is not None:
        off = _bias_error_degps(recording)
        notes["gyro_bias"] = f"band {BAND_NAME}" + ("" if off is None else f", off by {words.number_text(off)}°/s at the end")
    return notes


def _bias_error_degps(recording):
    """At the end, by the summary; None without one."""
    off = (recording.summary.get("estimate") or {}).get("gyro_bias_error")
    return None if off is None else math.degrees(off)


def known_sentence(recording):
    """How large the errors of estimate and measurement were; empty for a run without either."""
    parts = []
    if recording.estimate is not None:
        e = recording.estimate
        parts.append(f"Its own estimate was off by {words.number_text(e.tilt_deg.rms())}° of tilt and "
                     f"{_length(e.place_m.rms())} of place (rms), inside its {BAND_NAME} band {_share(e.tilt_deg.inside())} "
                     f"and {_share(e.place_m.inside())} of the time.")
    if recording.measured is not None:
        need = recording.measured.need
        parts.append(f"It measured f_s/N with an error of {words.number_text(need.rms())} (rms), "
                     f"{_share(need.inside())} of the time inside its band.")
    return " ".join(parts)


def belief_sentence(recording):
    """What the difference between belief and truth did; empty where only the truth is believed."""
    belief = recording.summary.get("belief")
    if not belief:
        return ""
    most = belief["mu_required"]["max"]
    said = (f"The robot that was believed would have needed f_s/N of {words.number_text(most)} and had at least "
            f"{words.number_text(belief['normal_force']['min'])} N")
    if not belief["holds"]:
        return f"{said}; it would have stopped rolling at {words.time_text(belief['time'])}."
    return f"{said}; it would have come to a place {_length(belief['position_error'])} from where the real one ended."


def known_table(recording):
    """The errors of estimate and measurement; None for a run without either."""
    rows = []
    for name, _, track, unit in tracks(recording):
        unit = f" [{unit}]" if unit else ""
        known = track.known
        if not known.any():
            continue
        least = max(float(np.max(track.sigma[known])), 1e-300) * 1e-9
        in_sigmas = np.abs(track.error[known]) / np.maximum(track.sigma[known, None], least)
        in_sigmas = in_sigmas[track.sigma[known] > 0]
        rows.append([name + unit, words.number_text(track.rms()), words.number_text(track.largest()),
                     words.number_text(float(track.sigma[known][-1])), _share(track.inside()),
                     words.number_text(float(in_sigmas.max())) if in_sigmas.size else "–"])
    if not rows:
        return None
    off = _bias_error_degps(recording)
    if off is not None:
        sigma = recording.estimate.bias_degps.sigma if recording.estimate is not None else np.zeros(0)
        sigma = sigma[np.isfinite(sigma)]
        rows.append(["gyro bias at the end [°/s]", "–", words.number_text(off),
                     words.number_text(float(sigma[-1])) if len(sigma) else "–", "–", "–"])
    return words.Table(f"What the robot knew ({BAND_NAME} holds 95 % of honest errors, over many runs)",
                       ["", "rms error", "largest error", "σ at the end", f"inside {BAND_NAME}", "largest in σ"], rows)


def flag_table(recording):
    """When the robot said that it slips or hardly touches the floor; None if it never did."""
    flags = recording.measured.flags if recording.measured is not None else []
    if not flags:
        return None
    names = {"slip": "slip", "light": "light contact"}
    return words.Table("Flagged by the robot", ["flag", "from [s]", "to [s]"],
                       [[names[flag.what], words.number_text(flag.start_s), words.number_text(flag.end_s)]
                        for flag in flags])


def belief_table(recording):
    """Predicted beside real; None where only the truth is believed."""
    belief, summary = recording.summary.get("belief"), recording.summary
    if not belief:
        return None

    def entry(section, part):
        return words.number_text((summary.get(section) or {}).get(part))

    number = words.number_text
    rows = [["most f_s/N", number(belief["mu_required"]["max"]), entry("mu_required", "max")],
            ["least N [N]", number(belief["normal_force"]["min"]), entry("normal_force", "min")]]
    found = recording.predicted
    if found is not None:
        end = found.place_m[-1]
        real = recording.driven()[-1]
        rows.append(["end [m]", f"({end[0]:.4f}, {end[1]:.4f})", f"({real[0]:.4f}, {real[1]:.4f})"])
    rows.append(["apart at the end", "–", _length(belief["position_error"])])
    return words.Table("Belief and truth: the same motion of the masses", ["", "the believed robot", "the real robot"], rows)


class KnownMap(FloorMap):
    """The floor with the true path, and where there are such the estimated one with its band and the believed one."""

    def __init__(self, recording):
        self._true = recording.driven()
        self._estimate = None if recording.estimate is None else recording.estimate.place_m
        self._believed = None if recording.predicted is None else recording.predicted.place_m
        places = [self._true]
        if self._estimate is not None:
            rows = self._estimate.known
            self._place, self._radius = self._estimate.value[rows], BAND_SIGMAS * self._estimate.sigma[rows]
            places += [self._place - self._radius[:, None], self._place + self._radius[:, None]]
        if self._believed is not None:
            places.append(self._believed)
        everything = np.concatenate(places)
        super().__init__(everything.min(axis=0), everything.max(axis=0), recording.patches)

    def svg(self):
        parts = []
        if self._estimate is not None:
            parts.append(self._band())
        parts.append(self._line(thinned(self._true), "driven"))
        ends = [("driven", self._true[-1])]
        if self._estimate is not None:
            parts.append(self._line(thinned(self._place), "estimated"))
            ends.append(("estimated", self._place[-1]))
        if self._believed is not None:
            parts.append(self._line(thinned(self._believed), "believed"))
            ends.append(("believed", self._believed[-1]))
        parts += [self._circle(place, 5 / self._scale, f"end-of {name}", "end") for name, place in ends]
        parts.append(self._circle(self._true[0], 6 / self._scale, "start", "start"))
        if self._estimate is not None:
            parts.append(self._circle(self._place[0], 0, "here").replace("<circle", '<circle id="estimate-here"'))
        parts.append(self._circle(self._true[0], 4 / self._scale, "truth").replace("<circle", '<circle id="truth-here"'))
        return self._drawing("known-map", "True and known path from above", parts)

    def _band(self):
        """Circles along the path: the stated sigma is that of the worst direction."""
        way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(self._place, axis=0), axis=1) + 1e-12)])
        rows = np.unique(np.append(np.searchsorted(way, np.linspace(0, way[-1], _CIRCLES)), len(way) - 1))
        rows = rows[rows < len(way)]
        circles = "".join(self._circle(self._place[row], self._radius[row], "sure") for row in rows)
        return f'<g class="sure-band">{circles}</g>'

    def legend(self):
        entries = [("driven", "true")]
        if self._estimate is not None:
            entries += [("estimated", "estimated"), ("sure", f"band {BAND_NAME}")]
        if self._believed is not None:
            entries.append(("believed", "the believed robot"))
        return "".join(key(name, text) for name, text in [*entries, *self._patch_kinds()])


def known_html(recording):
    """The section with the map. Empty for a run without estimate and belief."""
    if recording.estimate is None and recording.predicted is None:
        return ""
    drawing = KnownMap(recording)
    return (f'<section class="table full plan known"><h3>The path from above, and what the robot knew of it [m]</h3>'
            f'<p class="legend">{drawing.legend()}</p>{drawing.svg()}</section>')
