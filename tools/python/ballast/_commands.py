"""Commands as functions: friction in this process; integrate, plan and sweep by the programs, whose files they read."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from . import _core, _toml
from ._errors import RunError
from ._program import COMPLETED, OUTSIDE, run_program
from ._run import Run
from ._scenario import Scenario, as_scenario


def friction(scenario) -> dict[str, Any]:
    """How much friction a scenario needs on a floor that holds everything, when, and which mass causes it.

    scenario   a Scenario, or what Scenario() takes, without faults

    Returns `required_friction` of summary.json (tools/docs/summary.schema.json): `text`, `normal_force` and
    `static_friction` (N) where f_s / N is greatest, and `parts`, the share of each mass in it. Beside these `mu_required`
    {max, time}, `end` {reason, time} and `page`, what `ballast friction` prints.

    Raises ScenarioError, and RunError in the words of the command.
    """
    return json.loads(_core.friction(as_scenario(scenario).checked()))


def integrate(scenario, method: str = "dop853", *, tolerance: float | None = None, step_s: float | None = None,
              out: str | os.PathLike[str] | None = None) -> dict[str, Any]:
    """Rolls a scenario's prescribed motion by one numerical method, or "all" of them (tools/docs/integrate.md).

    tolerance  relative and absolute, 1e-13 to 1e-2; None: 1e-10
    step_s     fixed steps of this length; None: chosen by the tolerance
    out        folder for integrators.json and summary.json; None: they are not kept

    Returns integrators.json, and with it `summary`, that of the run. Raises ScenarioError and RunError.
    """
    options = [f"--method={method}"]
    options += [] if tolerance is None else [f"--tolerance={float(tolerance)!r}"]
    options += [] if step_s is None else [f"--step={float(step_s)!r}"]
    with _folder(out) as folder, _file_of(scenario) as file:
        status, _, words = run_program("integrate", f"--out={folder}", "--quiet", *options, "--", str(file))
        if status not in (COMPLETED, OUTSIDE):
            raise RunError(words)
        results = json.loads((folder / "integrators.json").read_text(encoding="utf-8"))
        results["summary"] = Run.load(folder).summary
        return results


class Plan:
    """The result of a search for a motion."""

    def __init__(self, claims: Mapping[str, Any], file: Path | None):
        self.claims = dict(claims)
        self.file = file

    @property
    def status(self) -> str:
        """found, infeasible or not_found."""
        return self.claims["status"]

    @property
    def found(self) -> bool:
        """Whether there is a motion."""
        return self.status == "found"

    @property
    def binding(self) -> str:
        """The limit that binds the plan, or stands in its way, in words."""
        return self.claims["binding"]

    @property
    def scenario(self) -> Scenario:
        """The scenario with the motion, for run(). Raises RunError where none was found."""
        if self.file is None:
            raise RunError(f"no plan: {self.binding}")
        return Scenario(self.file)

    def __repr__(self) -> str:
        return f"<ballast.Plan {self.status}: {self.binding}>"


def plan(task, out: str | os.PathLike[str], *, seed: int = 0, time_limit_s: float | None = None,
         start_from: str | os.PathLike[str] | None = None) -> Plan:
    """Finds a motion of the masses that takes the ball where a task says (tools/docs/plan.md).

    task          a Scenario with a [task], or what Scenario() takes
    out           file for the plan, NAME.toml; its claims go beside it, NAME.json
    seed          of the random starts
    time_limit_s  after which the best plan so far is taken; None: no limit
    start_from    the plan of a similar task

    The search runs in a program of its own; Ctrl-C ends it. That no plan exists is a result. Raises ScenarioError, and
    RunError in the words of the command.
    """
    file = Path(out)
    options = [f"--out={file}", f"--seed={int(seed)}", "--quiet"]
    options += [] if time_limit_s is None else [f"--time-limit={float(time_limit_s)!r}"]
    options += [] if start_from is None else [f"--from={os.fspath(start_from)}"]
    with _file_of(task) as task_file:
        status, _, words = run_program("plan", *options, "--", str(task_file))
    if status not in (COMPLETED, OUTSIDE):
        raise RunError(words)
    claims = json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))
    return Plan(claims, file if status == COMPLETED else None)


class Columns(Mapping):
    """The columns of sweep.nc by name: row, seed, exit_status, held, the varied keys and the kept values.

    A name has dots or, as in the file, `_`. A column is an array over the rows, with a second axis for lists: of numbers, of
    bool (held), or of str. NaN or an empty text: the run has no such value. Each is read from the file when it is first asked
    for.

        columns = sweep.columns
        columns["mu_required.max"][columns["held"]]
    """

    def __init__(self, file: Path):
        self._file = file
        if not file.is_file():
            raise RunError(f"{file}: No such file")
        self._meanings = dict(_core.sweep_columns(os.fspath(file)))
        self._read: dict[str, np.ndarray] = {}

    def meaning(self, name: str) -> str:
        """The column in words."""
        return self._meanings[self._in_file(name)]

    def __getitem__(self, name: str) -> np.ndarray:
        name = self._in_file(name)
        if name not in self._read:
            values = np.asarray(_core.sweep_column(os.fspath(self._file), name))
            if name == "held":
                values = values != 0
            values.flags.writeable = False
            self._read[name] = values
        return self._read[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._meanings)

    def __len__(self) -> int:
        return len(self._meanings)

    def __repr__(self) -> str:
        return f"<columns of {self._file}: {', '.join(self)}>"

    def _ipython_key_completions_(self):
        return list(self)

    def _in_file(self, name):
        found = str(name).replace(".", "_")
        if found not in self._meanings:
            raise KeyError(f"{name}: no such column; allowed: {', '.join(self)}")
        return found


class Sweep:
    """The results of a sweep: a folder with sweep.nc and the page that the command prints."""

    def __init__(self, folder: str | os.PathLike[str]):
        self.folder = Path(folder)
        self.columns = Columns(self.file)

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Sweep:
        """The sweep in a folder that sweep() or `ballast sweep` has left. Raises RunError where there is none."""
        return cls(folder)

    @property
    def file(self) -> Path:
        """sweep.nc, in NetCDF-4: a row per run (tools/docs/sweep.md)."""
        return self.folder / "sweep.nc"

    @property
    def page(self) -> str:
        """The summary in words: shares that hold, quantiles, the worst run."""
        path = self.folder / "summary.txt"
        try:
            return path.read_text(encoding="utf-8")
        except OSError as error:
            raise RunError(f"{path}: {error.strerror}") from error

    def __len__(self) -> int:
        """The number of runs."""
        return len(self.columns["row"])

    def __repr__(self) -> str:
        return f"<ballast.Sweep of {len(self)} runs in {self.folder}>"


def sweep(spec: str | os.PathLike[str] | Mapping[str, Any], out: str | os.PathLike[str], *, jobs: int | None = None,
          resume: bool = False, map_keys: tuple[str, str] | None = None) -> Sweep:
    """Runs a scenario many times with varied values, on all cores (tools/docs/sweep.md).

    spec      a sweep file, or a dict of its keys
    out       folder for the results
    jobs      runs at a time; None: one per core
    resume    continue in a folder with finished blocks of this sweep
    map_keys  two varied keys: draws the share of the runs that hold over them, as map.png in the folder

    The runs are made by a program of its own; Ctrl-C ends it, and the finished blocks are kept. Raises RunError in the words
    of the command.
    """
    folder = Path(out)
    options = [f"--out={folder}", "--quiet"]
    options += [] if jobs is None else [f"--jobs={int(jobs)}"]
    options += ["--resume"] if resume else []
    options += [] if map_keys is None else [f"--map={','.join(map_keys)}"]
    with tempfile.TemporaryDirectory(prefix="ballast-") as temporary:
        file = Path(temporary) / "sweep.toml"
        if isinstance(spec, Mapping):
            file.write_text(_toml.document(spec), encoding="utf-8")
        else:
            file = Path(spec)
        status, _, words = run_program("sweep", *options, "--", str(file))
    if status != COMPLETED:
        raise RunError(words)
    return Sweep(folder)


@contextmanager
def _folder(out) -> Iterator[Path]:
    """The folder for results, or a temporary one."""
    if out is not None:
        yield Path(out)
        return
    with tempfile.TemporaryDirectory(prefix="ballast-") as temporary:
        yield Path(temporary) / "results"


@contextmanager
def _file_of(source) -> Iterator[Path]:
    """A file that holds the scenario. Raises ScenarioError for a bad one."""
    scenario = as_scenario(source)
    with tempfile.TemporaryDirectory(prefix="ballast-") as temporary:
        file = Path(temporary) / f"{scenario.name}.toml"
        scenario.save(file)
        yield file
