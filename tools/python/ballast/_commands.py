"""Commands as functions: friction in this process; integrate, plan and sweep by the programs, whose files they read."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from . import _core, _toml
from ._errors import RunError
from ._program import run_program
from ._run import Run
from ._scenario import Scenario, as_scenario

_FOUND, _NO_PLAN = 0, 3  # exit statuses


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
        if status not in (_FOUND, _NO_PLAN):
            raise RunError(words)
        results = json.loads((folder / "integrators.json").read_text(encoding="utf-8"))
        results["summary"] = Run.load(folder).summary
        return results


class Plan:
    """What a search for a motion has come to."""

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
        """What limits the plan, or stands in its way, in words."""
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
    if status not in (_FOUND, _NO_PLAN):
        raise RunError(words)
    claims = json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))
    return Plan(claims, file if status == _FOUND else None)


class Sweep:
    """A finished sweep: a folder with sweep.nc, and the page that the command prints."""

    def __init__(self, folder: Path, page: str):
        self.folder, self.page = folder, page

    @property
    def file(self) -> Path:
        """sweep.nc, in NetCDF-4: a row per run (tools/docs/sweep.md)."""
        return self.folder / "sweep.nc"

    def __repr__(self) -> str:
        return f"<ballast.Sweep in {self.folder}>\n{self.page}"


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
        status, page, words = run_program("sweep", *options, "--", str(file))
    if status != _FOUND:
        raise RunError(words)
    return Sweep(folder, page)


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
