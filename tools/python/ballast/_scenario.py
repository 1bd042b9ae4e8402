"""Scenarios: loaded, changed and checked."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from . import _core, _toml

_FROM_DICT = "dict"  # in the place of the file's name in errors


class Scenario:
    """A scenario: one run of one robot on one floor, from a TOML file or a dict, with changed keys.

    Keys, units and defaults: tools/docs/scenario.md. A key is dotted; masses count from 0: "mass.1.rail.radius".

        scenario = ballast.Scenario("paper_ball")        # the name of a shipped scenario, or a file
        scenario.set("surface.static_friction", 0.17)    # as --set
        scenario["mass.1.mass"] = 2.0                    # the same
        scenario.check()

    Nothing is checked before check(), run() or another use, so keys that have to fit each other may be set one by one.
    """

    def __init__(self, source: str | os.PathLike[str] | Mapping[str, Any], *,
                 set: Mapping[str, Any] | None = None,  # pylint: disable=redefined-builtin
                 faults: Iterable[str] = ()):
        """`source`: the name of a shipped scenario, a file, or a dict of a scenario's keys. `set`: keys to change.
        `faults`: as --fault takes them, "motor_stall@1.5:mass=0".

        Raises ScenarioError for a name that is neither.
        """
        self._file: str | None = None
        self._text: str | None = None
        if isinstance(source, Mapping):
            self._text = _toml.document(source)
        else:
            self._file = _core.find_scenario(os.fspath(source))
        self._checked: _core.CheckedScenario | None = None
        self._owner: object = None  # of the file's folder, which goes with it
        self._overrides: list[str] = []
        self._faults: list[str] = []
        for fault in [faults] if isinstance(faults, str) else faults:
            self.add_fault(fault)
        if not isinstance(set, (Mapping, type(None))):
            raise TypeError(f"set: {type(set).__name__} is not allowed; allowed: a dict of dotted keys")
        for key, value in (set or {}).items():
            self.set(key, value)

    def set(self, key: str, value: Any) -> Scenario:
        """Replaces the value of a dotted key. Returns the scenario itself.

        Raises TypeError for a value that TOML has no type for.
        """
        _require_text(key)
        if "=" in key:
            raise ValueError(f"{key!r}: a key has no '='; allowed: a dotted key such as 'mass.1.mass'")
        key.encode()  # raises UnicodeEncodeError, as for a value
        self._overrides.append(f"{key}={_toml.override_text(value, key)}")
        self._checked = None
        return self

    def add_fault(self, fault: str) -> Scenario:
        """Injects a fault, "KIND@TIME[:PARAM]" as for --fault; `ballast faults` lists the kinds. Returns the scenario."""
        if not isinstance(fault, str):
            raise TypeError(f"fault: {type(fault).__name__} is not allowed; allowed: str")
        self._faults.append(fault)
        self._checked = None
        return self

    def check(self) -> list[str]:
        """Returns the warnings: values that are allowed and implausible.

        Raises ScenarioError with every error in the scenario.
        """
        return [text for _, text in self.checked().warnings]

    def copy(self) -> Scenario:
        """A scenario of its own with the same source and changes."""
        other = object.__new__(Scenario)
        other._file, other._text, other._owner = self._file, self._text, self._owner
        other._overrides, other._faults, other._checked = self._overrides[:], self._faults[:], self._checked
        return other

    def __getstate__(self):
        return {**self.__dict__, "_checked": None}  # is made again where it is needed

    @property
    def name(self) -> str:
        """Names the folder of results. Raises ScenarioError, as all that needs a good scenario."""
        return self.checked().name

    @property
    def duration_s(self) -> float:
        """s of the run."""
        return self.checked().duration_s

    @property
    def control_period_s(self) -> float:
        """s from one control tick to the next."""
        return self.checked().control_period_s

    @property
    def actuation(self) -> str:
        """How the masses are moved: "stepper", "ideal" or "prescribed"."""
        return self.checked().actuation

    @property
    def mass_count(self) -> int:
        """The number of masses."""
        return self.checked().mass_count

    @property
    def fingerprint(self) -> int:
        """Equal for equal scenarios, and in every message of a run as `scenario_id`."""
        return self.checked().id

    def to_dict(self) -> dict[str, Any]:
        """All keys that are written or set, as a dict from which Scenario() makes an equal scenario."""
        return tomllib.loads(self.to_toml())

    def to_toml(self) -> str:
        """A scenario file that gives this scenario, from any folder."""
        return self.checked().toml

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes to_toml() into a file."""
        Path(path).write_text(self.to_toml(), encoding="utf-8")

    def __getitem__(self, key: str) -> Any:
        """The value of a dotted key as written or set; a table as a dict. Raises KeyError where none is written, as for
        a key that has its default."""
        _require_text(key)
        found: Any = tomllib.loads(_core.changed_toml(self._source_text(), self._source_name(), self._overrides, []))
        for part in key.split("."):
            try:
                found = found[int(part) if isinstance(found, list) and part.isdecimal() else part]
            except (KeyError, IndexError, ValueError, TypeError):
                raise KeyError(key) from None
        return found

    def __setitem__(self, key: str, value: Any) -> None:
        self.set(key, value)

    def __repr__(self) -> str:
        changes = "".join(f" --set {override}" for override in self._overrides)
        return f"<ballast.Scenario {self._source_name()}{changes}{''.join(f' --fault {fault}' for fault in self._faults)}>"

    def checked(self) -> _core.CheckedScenario:
        """The scenario for the functions in C++. Raises ScenarioError."""
        if self._checked is None:
            if self._file is not None:
                self._checked = _core.check_file(self._file, self._overrides, self._faults)
            else:
                self._checked = _core.check_text(self._text, _FROM_DICT, self._overrides, self._faults)
        return self._checked

    def _source_name(self):
        return self._file if self._file is not None else _FROM_DICT

    def _source_text(self):
        return self._text if self._text is not None else Path(self._file).read_text(encoding="utf-8")


def _require_text(key):
    if not isinstance(key, str):
        raise TypeError(f"key: {type(key).__name__} is not allowed; allowed: a str such as 'mass.1.mass'")


def as_scenario(source) -> Scenario:
    """A scenario, or one made of a name, a file or a dict."""
    return source if isinstance(source, Scenario) else Scenario(source)


def scenario_in(folder: Path, owner) -> Scenario:
    """The scenario of the run in a folder. It keeps the owner, with which the folder would go; None: the folder stays."""
    scenario = Scenario(folder / "scenario.toml")
    scenario._owner = owner  # pylint: disable=protected-access
    return scenario
