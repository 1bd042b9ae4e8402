"""Ballast: rolling-ball robots driven by internal masses, from Python.

    import ballast
    scenario = ballast.Scenario("paper_ball").set("mass.1.mass", 2.0)
    run = ballast.run(scenario)
    run.summary["mu_required"]["max"]        # as in summary.json
    run.channels["contact"].normal_force_n   # a NumPy array over the ticks, N
    run.plot()                               # a matplotlib figure

A run is the command's: the same scenario and seed leave the same bytes in run.lcmlog as `ballast run`, and the same
summary.json but for the wall time.

    Scenario                      a scenario file or dict, with changed keys
    run, Run                      a run and its results
    Ball, rolling_forces, ...     the paper's closed forms over arrays
    Plant, Environment            the simulated ball, stepped by hand or by an agent
    friction, integrate, plan, sweep   the commands of these names
    ScenarioError, RunError       what can go wrong, in the words of the commands

SI or consistent units throughout. A name ends in its unit; `_B` is the body frame, `_W` the space frame. Attitudes are
unit quaternions (w, x, y, z) that take body to space. Symbols are those of Putkaradze and Rogers, "On the Normal Force and
Static Friction Acting on a Rolling Ball Actuated by Internal Point Masses". tools/docs/python.md is the page;
an installation has the pages below share/doc/ballast.
"""

from ._closed_forms import (Ball, DetachedDiskMotion, DetachedDiskMotionJacobian, DetachedMotion, DetachedMotionJacobian,
                            RailPoint, RollingDiskForces, RollingDiskForcesJacobian, RollingForces, RollingForcesDerivative,
                            RollingForcesJacobian, detached_disk_motion, detached_motion, rolling_disk_forces,
                            rolling_forces)
from ._commands import Columns, Plan, Sweep, friction, integrate, plan, sweep
from ._core import version as __version__
from ._environment import Environment
from ._errors import BallastError, Finding, RunError, RunWarning, ScenarioError
from ._plant import Plant, PlantState
from ._run import Channel, Channels, Run, run
from ._scenario import Scenario

__all__ = [
    "Ball", "BallastError", "Channel", "Channels", "Columns", "DetachedDiskMotion", "DetachedDiskMotionJacobian", "DetachedMotion",
    "DetachedMotionJacobian", "Environment", "Finding", "Plan", "Plant", "PlantState", "RailPoint", "RollingDiskForces",
    "RollingDiskForcesJacobian", "RollingForces", "RollingForcesDerivative", "RollingForcesJacobian", "Run", "RunError",
    "RunWarning", "Scenario", "ScenarioError", "Sweep", "__version__", "detached_disk_motion", "detached_motion", "friction",
    "integrate", "plan", "rolling_disk_forces", "rolling_forces", "run", "sweep",
]
for _name in __all__:
    if hasattr(globals()[_name], "__module__"):
        globals()[_name].__module__ = __name__  # help() and messages name what a user imports
del _name
