"""Assembles the page: one HTML file that works without a network or a server.

The sources in page/ and the files of the packages become modules of an import map. Their data: URLs work from file://.
Samples are stored as columns of float32: differences of bit patterns, separated into byte planes, gzip, base64. Smooth
signals then take a third of their size. page/samples.js decodes them.
"""

import base64
import gzip
import hashlib
import html
import json
import math
import re
from pathlib import Path

import numpy as np

import words
from known_report import (belief_sentence, belief_table, flag_table, known_html, known_sentence, known_table, plot_notes)
from packages import Package
from plan_map import plan_html, plan_sentence, plan_table

_PAGE = Path(__file__).resolve().parent / "page"
_LONG_CELL = 32  # letters; longer cells are broken into lines
DRAWING_MODULES = ("numbers.js", "samples.js", "panels.js", "plots.js", "scene.js", "robot.js", "path.js", "resolution.js",
                   "theme.js")
_RUN_MODULES = ("main.js", "clock.js", *DRAWING_MODULES)


def page_begins(maker):
    """The first bytes of every page of the command `maker`, "report" or "compare"."""
    return f"<!doctype html>\n<!-- ballast {maker} -->\n".encode()


def report_page(recording):
    return _page("report", [recording], recording.name, _report_head(recording), _report_tables(recording))


def compare_page(recordings, title, head, tables):
    """`head` and `tables` are the HTML above and below the plots."""
    return _page("compare", recordings, title, head, tables)


def _page(maker, recordings, title, head, tables):
    described = {"runs": [_described(recording) for recording in recordings]}
    return one_file(_PAGE / "page.html", own_modules(*_RUN_MODULES), {
        "maker": maker,
        "title": html.escape(title),
        "head": head,
        "tables": tables,
        "described": script_json(described),
        "samples": "".join(f'<script type="text/plain" id="samples-{i}">{_packed(recording)}</script>\n'
                           for i, recording in enumerate(recordings)),
    })


def own_modules(*names, folder=_PAGE):
    """The sources of modules in a folder, by their names in the import map."""
    return {f"ballast/{name}": (folder / name).read_text(encoding="utf-8") for name in names}


def one_file(template, own, parts, style="", connects="'none'"):
    """The page: a template's file with its `parts`, the modules `own`, which "ballast/main.js" starts, and all packages.

    `style` is added to that of all pages. `connects` is where the page may connect to (connect-src).
    """
    three, uplot = Package("three"), Package("uplot")
    modules = {
        "three": three.text("build/three.module.min.js"),
        "three/OrbitControls": three.text("examples/jsm/controls/OrbitControls.js"),
        "uplot": uplot.text("dist/uPlot.esm.js"),
        **own,
    }
    import_map = json.dumps({"imports": {name: "data:text/javascript;base64," + _base64(text.encode())
                                         for name, text in modules.items()}})
    start = 'import "ballast/main.js";'
    licences = "".join(f"<h4>{html.escape(p.name)} {html.escape(p.version)}</h4><pre>{html.escape(p.text('LICENSE'))}"
                       "</pre>" for p in (three, uplot))
    parts = {
        **parts,
        "policy": f"default-src 'none'; script-src data: {_hash(import_map)} {_hash(start)}; "
                  f"style-src 'unsafe-inline'; img-src data: blob:; connect-src {connects}",
        "style": uplot.text("dist/uPlot.min.css") + (_PAGE / "style.css").read_text(encoding="utf-8") + style,
        "licences": licences,
        "import_map": import_map,
        "start": start,
    }
    # One pass, so that inserted text is not substituted again.
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], template.read_text(encoding="utf-8"))


def _base64(data):
    return base64.b64encode(data).decode("ascii")


def _hash(script):
    return f"'sha256-{_base64(hashlib.sha256(script.encode()).digest())}'"


def script_json(value):
    """JSON that cannot end the script element it stands in."""
    return json.dumps(finite(value), ensure_ascii=True, allow_nan=False).replace("<", "\\u003c")


def finite(value):
    """A copy of `value` with None in place of NaN and infinity, which JSON lacks."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _described(recording):
    """The data of a run, other than its samples, that the page's scripts use."""
    summary = recording.summary
    friction = recording.static_friction_coefficient
    return {
        "name": recording.name,
        "actuation": summary.get("actuation"),
        "rows": len(recording.columns["time"]),
        "columns": packed_names(recording),
        "radius": recording.robot["ball"]["radius"],
        "gravity": recording.robot.get("gravity"),
        "shell_mass": recording.robot["ball"].get("mass"),
        "masses": recording.robot["masses"],
        "static_friction": friction,  # null: perfect, or not known
        "friction_known": friction is not None,
        "friction_changes": recording.static_friction_under_ball is not None,
        "patches": described_patches(recording.patches),
        "plan_may_use": recording.planned.friction_limit if recording.planned is not None else None,
        "envelope": summary.get("envelope"),
        "regimes": summary.get("regimes") or [],
        "impacts": [impact["time"] for impact in summary.get("impacts") or []],
        "flags": [flag._asdict() for flag in recording.measured.flags] if recording.measured is not None else [],
        "notes": plot_notes(recording),
        "commanded": "commanded, as believed" if recording.commands_as_believed else "commanded",
        "events": [{"time": time, "text": text} for time, text in words.events(recording)],
        "extremes": {
            "normal_force": _extreme(summary, "normal_force", "min", "min_time"),
            "static_friction": _extreme(summary, "static_friction", "max", "time"),
            "mu_required": _extreme(summary, "mu_required", "max", "time"),
        },
    }


def described_patches(patches):
    return [{"kind": patch.kind, "text": patch.text,
             **({"polygon": patch.corners.tolist()} if patch.corners is not None else
                {"center": patch.center.tolist(), "radius": patch.radius})} for patch in patches]


def _extreme(summary, section, key, when):
    entry = summary.get(section) or {}
    if entry.get(key) is None or entry.get(when) is None:
        return None
    return {"value": entry[key], "time": entry[when], "what": "least" if key == "min" else "most"}


def packed_names(recording):
    """The names of the packed columns. Time is `time` + `time_rest`, since float32 has no microseconds at 20 s."""
    return [*recording.columns, "time_rest"]


def _packed(recording):
    columns = dict(recording.columns)
    time = np.asarray(columns["time"], dtype=float)
    columns["time"] = time.astype(np.float32)
    columns["time_rest"] = time - columns["time"]
    planes = []
    for name in packed_names(recording):
        with np.errstate(over="ignore"):
            values = np.ascontiguousarray(columns[name], dtype="<f4")
        values[~np.isfinite(values)] = np.nan
        bits = values.view("<u4")
        steps = np.diff(bits, prepend=np.uint32(0)).astype("<u4")  # modulo 2^32
        planes.append(steps.view(np.uint8).reshape(-1, 4).T.tobytes())
    return _base64(gzip.compress(b"".join(planes), 9, mtime=0))


def table_html(table, class_name=""):
    head = "".join(f"<th scope=\"col\">{symbols(cell)}</th>" for cell in table.head)
    rows = "".join("<tr>" + "".join(_cell(cell) for cell in row) + "</tr>" for row in table.rows)
    return (f'<section class="table {class_name}"><h3>{html.escape(table.title)}</h3><div class="wide"><table><thead>'
            f"<tr>{head}</tr></thead><tbody>{rows}</tbody></table></div></section>")


def _cell(text):
    return f"<td{' class=long' if len(text) > _LONG_CELL else ''}>{symbols(text)}</td>"


def symbols(text):
    """`text` as HTML, with the paper's symbols in print."""
    text = html.escape(str(text))
    text = re.sub(r"\bf_s\b", "<i>f</i><sub>s</sub>", text)
    return re.sub(r"\bmu_s\b", "<i>μ</i><sub>s</sub>", text)


def notes_html(recording, prefix=""):
    return "".join(f'<p class="note" role="note">{html.escape(prefix + note)}</p>' for note in recording.notes)


def _report_head(recording):
    text, kind = words.badge(recording)
    actuation = {"stepper": "stepper-driven masses", "prescribed": "prescribed masses",
                 "ideal": "ideal masses, exactly where the controller commands"}.get(
        recording.summary.get("actuation"), "")
    cards = "".join(_card(number) for number in words.numbers(recording))
    sentences = [sentence for sentence in (*words.sentences(recording), plan_sentence(recording), known_sentence(recording),
                                      belief_sentence(recording)) if sentence]
    said = " ".join(f"<span>{symbols(sentence)}</span>" for sentence in sentences)
    return (f'<h1>{html.escape(recording.name)}<span class="badge {kind}">{html.escape(text)}</span></h1>'
            f'<p class="subtitle">{html.escape(actuation)}</p>{notes_html(recording)}'
            f'<p class="said">{said}</p><dl class="cards">{cards}</dl>')


def _card(number):
    """The HTML of one number. `data-value` has all digits of the summary."""
    value = "perfect" if number.path == "surface.static_friction" and number.value is None else \
        number.text
    unit = f" <small>{html.escape(number.unit)}</small>" if number.unit and number.value is not None else ""
    when = f'<small class="when">{words.time_text(number.when)}</small>' if number.when is not None else ""
    exact = html.escape(json.dumps(finite(number.value)), quote=True)
    return (f"<div><dt>{symbols(number.label)}</dt><dd data-path=\"{html.escape(number.path)}\" data-value=\"{exact}\">"
            f"<b>{value}</b>{unit}{when}</dd></div>")


def _report_tables(recording):
    special = [plan_table(recording), known_table(recording), belief_table(recording), flag_table(recording)]
    tables = [table for table in special if table] + words.tables(recording)
    return plan_html(recording) + known_html(recording) + "".join(table_html(table) for table in tables)
