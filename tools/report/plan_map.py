"""The plan of a run as the report shows it: a map from above (SVG), a table, a sentence, and the planned need."""

import numpy as np

import words
from floor_map import FloorMap, key, thinned


class PlanMap(FloorMap):
    """`driven` has a row (x, y) per sample."""

    def __init__(self, planned, driven, patches=()):
        self._planned, self._driven, self._end = planned, thinned(driven), driven[-1]
        super().__init__(*self._extent(driven), patches)

    def _extent(self, driven):
        planned, r = self._planned, self._planned.radius
        rows = [driven - r, driven + r, planned.path[:, 1:3], [planned.goal - r, planned.goal + r],
                *([place] for place, _ in planned.via)]
        rows += [[center - radius - r, center + radius + r] for center, radius in planned.keep_out]
        if planned.follow is not None:
            points, tolerance = planned.follow
            rows += [points - tolerance, points + tolerance]
        everything = np.concatenate([np.reshape(np.asarray(row, dtype=float), (-1, 2)) for row in rows])
        return everything.min(axis=0), everything.max(axis=0)

    def _marks(self):
        planned = self._planned
        x, y = self._at(planned.goal)
        parts = [f'<path class="goal" d="M{x - 9:.1f} {y - 9:.1f}l18 18m0-18l-18 18"><title>goal</title></path>']
        for number, (place, time) in enumerate(planned.via):
            x, y = self._at(place)
            when = "" if time is None else f", t = {time:g} s"
            parts.append(f'<path class="via" d="M{x:.1f} {y - 8:.1f}l8 8-8 8-8-8z"><title>via place {number}{when}</title>'
                         f'</path><text class="via-number" x="{x + 11:.1f}" y="{y - 7:.1f}">{number}</text>')
        return "".join(parts)

    def svg(self):
        planned, parts = self._planned, []
        if planned.follow is not None:
            points, tolerance = planned.follow
            band = self._line(points, "band").replace(
                "/>", f' style="stroke-width: {2 * tolerance * self._scale:.1f}"/>')
            parts += [band, self._line(points, "follow")]
        parts += [self._circle(center, radius + planned.radius, "clearance", "the centre stays outside")
                  for center, radius in planned.keep_out]
        parts += [self._circle(center, radius, "obstacle", f"keep_out.{number}")
                  for number, (center, radius) in enumerate(planned.keep_out)]
        parts += [self._circle(place, planned.radius, "ball") for place in (self._driven[0], self._end)]
        parts += [self._line(self._driven, "driven"), self._line(planned.path[:, 1:3], "planned")]
        dot = self._circle(self._driven[0], 5 / self._scale, "start", "start")
        end = self._circle(self._end, 5 / self._scale, "end", "end")
        here = self._circle(self._driven[0], planned.radius, "here").replace("<circle", '<circle id="plan-here"')
        return self._drawing("plan-map", "The plan from above", [*parts, self._marks(), dot, end, here])

    def legend(self):
        planned = self._planned
        entries = [("driven", "driven"), ("planned", "planned"), ("goal", "goal, at rest" if planned.at_rest else "goal")]
        if planned.via:
            entries.append(("via", "via place"))
        if planned.keep_out:
            entries += [("obstacle", "keep out"), ("clearance", "where the ball would reach into it")]
        if planned.follow is not None:
            entries.append(("band", f"path to follow, within {words.number_text(planned.follow[1])} m"))
        entries.append(("ball", "ball at start and end"))
        return "".join(key(name, text) for name, text in [*entries, *self._patch_kinds()])


def _distance_text(metres):
    return f"{1e3 * metres:.3g} mm" if metres < 0.01 else f"{metres:.3g} m"


def _place_text(place):
    return f"({place[0]:.4f}, {place[1]:.4f})".replace("-0.0000", "0.0000")


def plan_html(recording):
    """The section of the report. Empty for a run without a plan."""
    planned = recording.planned
    if planned is None:
        return ""
    drawing = PlanMap(planned, recording.driven(), recording.patches)
    return (f'<section class="table full plan"><h3>The plan from above [m]</h3><p class="legend">{drawing.legend()}</p>'
            f"{drawing.svg()}</section>")


def plan_table(recording):
    """Planned beside driven; None for a run without a plan."""
    planned = recording.planned
    if planned is None or not len(planned.path):
        return None
    driven = recording.driven()
    needed = recording.summary.get("mu_required") or {}
    off = np.linalg.norm(recording.columns_place() - planned.place_at(recording.columns["time"]), axis=1)
    number = words.number_text
    rows = [["end [m]", _place_text(planned.path[-1, 1:3]), _place_text(driven[-1])],
            ["distance from the goal", _distance_text(np.linalg.norm(planned.path[-1, 1:3] - planned.goal)),
             _distance_text(np.linalg.norm(driven[-1] - planned.goal))],
            ["most f_s/N", number(planned.need), number(needed.get("max"))],
            ["farthest from the planned place at the same time", "–", _distance_text(float(off.max()))]]
    if planned.friction_limit is not None:
        rows.append([f"a plan may use {number(planned.use)} mu_s", number(planned.friction_limit), "–"])
    return words.Table("The plan", ["", "planned", "driven"], rows)


def plan_sentence(recording):
    """How near the run came to its goal; empty for a run without a plan."""
    planned = recording.planned
    if planned is None:
        return ""
    off = float(np.linalg.norm(recording.driven()[-1] - planned.goal))
    goal = f"({words.number_text(planned.goal[0])}, {words.number_text(planned.goal[1])})"
    return f"Its goal was {goal} m; it ended {_distance_text(off)} from there."
