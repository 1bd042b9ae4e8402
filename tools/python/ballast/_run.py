"""Runs and their results."""

from __future__ import annotations

import base64
import functools
import html
import io
import json
import math
import os
import shutil
import tempfile
import warnings
import weakref
import webbrowser
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from . import _core
from ._errors import RunError, RunWarning
from ._program import COMPLETED, OUTSIDE, run_program
from ._scenario import Scenario, as_scenario, scenario_in

_CHANNEL_BEGINNING = "BALLAST_"
_CHANNELS = ("contact", "plant_state", "sensors", "step_command", "controller_status", "trip", "operator")
_PICTURE = "friction_required"  # the one that a notebook shows


def run(scenario: Scenario | str | os.PathLike[str] | Mapping[str, Any], out: str | os.PathLike[str] | None = None, *,
        actuation: str | None = None, seed: int | None = None, log: bool = True, speed: float | None = None) -> Run:
    """Runs a scenario: controller, plant and monitor in lockstep, as `ballast run` does in one process.

    scenario   a Scenario, or what Scenario() takes
    out        folder for the results (tools/docs/results.md); None: a temporary one that goes with the Run,
               its `channels` and its `scenario`
    actuation  "prescribed", "stepper" or "ideal"; None: the scenario's
    seed       of all random numbers, 0 to 2^63 - 1; None: the scenario's
    log        False keeps no run.lcmlog; reading `channels` then raises RunError
    speed      simulated time per wall time; None: as fast as possible

    Other threads go on during the run, and several may run at once, each in a folder of its own. Ctrl-C ends the run
    with KeyboardInterrupt; the log up to there stays.

    Raises ScenarioError for a bad scenario, RunError where the run could not come to its end. A run that slips, detaches
    or trips is a result: `end_reason` and `holds` say so. Warns with RunWarning of lost steps and the like.
    """
    scenario = as_scenario(scenario)
    if actuation is not None or seed is not None:
        scenario = scenario.copy()
        if actuation is not None:
            scenario.set("run.actuation", actuation)
        if seed is not None:
            scenario.set("seed", seed)
    pace = 0.0 if speed is None else float(speed)
    if speed is not None and not (math.isfinite(pace) and pace > 0):
        raise ValueError(f"speed: {speed} is out of range; allowed: a finite number > 0")
    checked = scenario.checked()
    for key, text in checked.warnings:
        if key == "task":  # nothing moves
            warnings.warn(text, RunWarning, stacklevel=2)
    if out is not None:
        folder = str(Path(out))
        if "\0" in folder:
            raise ValueError("out: a NUL character is not allowed")
        return _run_in(checked, folder, log, pace)
    owner = _TemporaryFolder()
    try:
        return _run_in(checked, owner.path, log, pace, owner)
    except BaseException:
        owner.remove()  # now: the traceback keeps the owner
        raise


class _TemporaryFolder:
    """Owns a folder, which goes with the last reference to this object."""

    def __init__(self):
        self.path = tempfile.mkdtemp(prefix="ballast-")
        self.remove = weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)

    def __deepcopy__(self, _) -> _TemporaryFolder:
        return self

    def __reduce__(self):
        return type(None), ()  # the folder stays this process's


def _run_in(checked: _core.CheckedScenario, folder: str, log: bool, pace: float,
            owner: _TemporaryFolder | None = None) -> Run:
    status, complaints = _core.run(checked, folder, not log, pace)
    if status not in (COMPLETED, OUTSIDE):
        raise RunError("\n".join(complaints))
    for complaint in complaints:
        warnings.warn(complaint, RunWarning, stacklevel=3)
    return Run(folder, _owner=owner)


class Channel:
    """The messages of one channel: a structured array, one record per message, in order.

    Each field of the message's .lcm file (lcmtypes/, with unit, frame and sign) is an attribute, an array without a copy:

        contact = run.channels["contact"]
        contact.time_s, contact.normal_force_n      # (n,)
        contact.friction_force_W_n                  # (n, 2)

    `array` is the whole; the arrays are read-only. Ticks count from t = 0; those before 0 are the countdown.
    """

    def __init__(self, name: str, array: np.ndarray):
        self.name, self.array = name, array

    @property
    def fields(self) -> tuple[str, ...]:
        """The names of the message's fields."""
        return self.array.dtype.names

    def __getattr__(self, name: str) -> np.ndarray:
        array = self.__dict__.get("array")  # none yet in a copy that is being made
        if array is None or name not in array.dtype.names:
            fields = "" if array is None else f"; it has {', '.join(array.dtype.names)}"
            raise AttributeError(f"this channel has no field {name}{fields}")
        return array[name]

    def __getitem__(self, index):
        """A field by its name, or messages by their place."""
        return self.array[index]

    def __len__(self) -> int:
        return len(self.array)

    def __dir__(self):
        return [*super().__dir__(), *self.fields]

    def __repr__(self) -> str:
        return f"<channel {self.name}: {len(self)} messages of {', '.join(self.fields)}>"


class Channels(Mapping):
    """The channels of a run's log, by name: contact, plant_state, sensors, step_command, controller_status, trip, operator.

    A channel is read from the log when it is first asked for. Raises RunError where there is no log; warns with RunWarning
    of one that is damaged, and has what comes before.
    """

    def __init__(self, log: Path, _owner: _TemporaryFolder | None = None):
        self._log, self._owner = log, _owner
        self._read: dict[str, Channel] = {}

    def __getitem__(self, name: str) -> Channel:
        short = str(name).removeprefix(_CHANNEL_BEGINNING).lower()
        if short not in _CHANNELS:
            raise KeyError(f"{name}: no such channel; allowed: {', '.join(_CHANNELS)}")
        if short not in self._read:
            self._read[short] = Channel(short, _messages(self._log, short))
        return self._read[short]

    def __iter__(self) -> Iterator[str]:
        return iter(_CHANNELS)

    def __len__(self) -> int:
        return len(_CHANNELS)

    def __repr__(self) -> str:
        return f"<channels {', '.join(self)}>"

    def _ipython_key_completions_(self):
        return list(self)


class Run:
    """A finished run: the folder that `ballast run` or run() has left."""

    def __init__(self, folder: str | os.PathLike[str], *, _owner: _TemporaryFolder | None = None):
        self.folder = Path(folder)
        self._owner = _owner
        path = self.folder / "summary.json"
        try:
            text = path.read_text(encoding="utf-8")
            self.summary: dict[str, Any] = json.loads(text)
        except OSError as error:
            raise RunError(f"{path}: {error.strerror}") from error
        except ValueError as error:
            raise RunError(f"{path}: not valid JSON: {error}") from error
        if not isinstance(self.summary, dict) or "end" not in self.summary:
            raise RunError(f"{path}: not the summary of a run")
        self.channels = Channels(self.folder / "run.lcmlog", _owner)
        self._recorded = None

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Run:
        """The run in a folder. Raises RunError where there is none."""
        return cls(folder)

    @property
    def end_reason(self) -> str:
        """completed, slipped, detached, tripped or inconsistent."""
        return self.summary["end"]["reason"]

    @property
    def holds(self) -> bool:
        """Whether the run came to its end inside its envelope: the command's exit status is then 0."""
        return self.end_reason == "completed" and self.summary["trip"] is None

    @property
    def scenario(self) -> Scenario:
        """The scenario that was run."""
        return scenario_in(self.folder, self._owner)

    def pictures(self) -> list[str]:
        """The names that plot() takes; not every picture applies to every run."""
        from ._pictures.pictures import PICTURES  # matplotlib is loaded for pictures only
        return list(PICTURES)

    def plot(self, picture: str = _PICTURE):
        """Draws one of the pictures of `ballast run --pictures` (tools/docs/pictures.md). Returns a matplotlib Figure.

        A notebook shows the figure. matplotlib's settings and backend stay as they are.

        Raises ValueError for an unknown picture or one that does not apply to this run, RunError where the log is missing.
        """
        from matplotlib.text import Text

        from ._pictures import page
        from ._pictures.event_log import LogError
        from ._pictures.pictures import PICTURES
        from ._pictures.recorded_run import RecordedRun
        if not isinstance(picture, str) or picture not in PICTURES:
            raise ValueError(f"{picture}: no such picture; allowed: {', '.join(PICTURES)}")
        try:
            if self._recorded is None:
                self._recorded = RecordedRun(self.folder)
            with page.style():
                figure = PICTURES[picture](self._recorded)
        except LogError as error:
            raise RunError(str(error)) from error
        if figure is None:
            raise ValueError(f"{picture}: does not apply to this run")
        for text in figure.findobj(Text):
            text.set_math_fontfamily(page.STYLE["mathtext.fontset"])  # otherwise decided when it is drawn
        figure._repr_png_ = functools.partial(_png, figure)  # pylint: disable=protected-access
        return figure

    def show(self, browser: bool = True) -> Path:
        """Makes the page of `ballast report`, with plots and 3-D replay, and opens it unless `browser` is False.

        Returns its file, report.html in the folder. Raises RunError in the words of the command.
        """
        page = self.folder / "report.html"
        status, _, words = run_program("report", f"--out={page}", "--", str(self.folder))
        if status != 0:
            raise RunError(words)
        if browser:
            webbrowser.open(page.resolve().as_uri())
        return page

    def __repr__(self) -> str:
        end = self.summary["end"]
        return f"<ballast.Run {self.summary['scenario']}: {end['reason']} at t = {end['time']:g} s, in {self.folder}>"

    def _repr_html_(self) -> str:
        """The summary as a table, and the friction that was needed as a picture, for a notebook."""
        left = "style='text-align:left;padding-right:1em'"
        rows = "".join(f"<tr><th {left}>{html.escape(name)}</th><td {left}>{html.escape(value)}</td></tr>"
                       for name, value in self._headlines())
        try:
            data = base64.b64encode(_png(self.plot())).decode()
            picture = f"<img alt='{_PICTURE}' src='data:image/png;base64,{data}'>"
        except (RunError, ValueError, ImportError):
            picture = ""  # no log, no contact, or no matplotlib
        return f"<table>{rows}</table>{picture}"

    def _headlines(self):
        """(name, value) of what a reader looks for first."""
        summary = self.summary
        yield "scenario", f"{summary['scenario']}, {summary['actuation']}"
        yield "ended", f"{summary['end']['reason']} at t = {summary['end']['time']:g} s"
        need, force = summary["mu_required"], summary["normal_force"]
        if need["max"] is not None:
            yield "most f_s/N", f"{need['max']:.3g} at t = {need['time']:.4g} s"
        if force["min"] is not None:
            yield "least N", f"{force['min']:.3g} N at t = {force['min_time']:.4g} s"
        floor = summary["surface"]["static_friction"]
        yield "this floor", "perfect friction" if floor is None else f"mu_s = {floor:g}"
        if summary["trip"] is not None:
            yield "trip", f"{summary['trip']['cause']} at t = {summary['trip']['time']:g} s"
        lost = {i: motor["lost_steps"] for i, motor in enumerate(summary["motors"] or []) if motor and motor["lost_steps"]}
        if lost:
            yield "lost microsteps", ", ".join(f"motor {i}: {count}" for i, count in lost.items())
        if summary["tracking"] is not None:
            yield "off the plan", f"{summary['tracking']['rms']:.3g} m rms, {summary['tracking']['max']:.3g} m at most"


def _png(figure) -> bytes:
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=80)
    return file.getvalue()


def _messages(log: Path, channel: str) -> np.ndarray:
    """The messages of a channel in this machine's byte order, read-only, without the fingerprint."""
    from . import _messages as types
    from ._pictures.event_log import EventLog, LogError
    name = _CHANNEL_BEGINNING + channel.upper()
    try:
        events = EventLog(log, [name])
        messages = events.messages(name, getattr(types, f"{channel}_t"))
    except LogError as error:
        raise RunError(str(error)) from error
    if events.damage:
        # The line that is named is that of the caller of Channels.__getitem__.
        warnings.warn(f"{log}: {events.damage}; read what comes before", RunWarning, stacklevel=3)
    fields = [(field, messages.dtype[field]) for field in messages.dtype.names if field != "fingerprint"]
    native = np.empty(len(messages), dtype=[(field, kind.base.newbyteorder("="), kind.shape) for field, kind in fields])
    for field, _ in fields:
        native[field] = messages[field]
    native.flags.writeable = False
    return native
