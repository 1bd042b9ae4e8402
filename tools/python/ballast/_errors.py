"""Exceptions, in the words of the commands."""

from __future__ import annotations

from typing import NamedTuple, Sequence


class Finding(NamedTuple):
    """One error in a scenario."""

    file: str | None   # "--set", "--fault ..." or "dict" where the value came from there
    line: int | None   # None: not known, as that of a key that is missing
    key: str | None    # dotted: mass.2.rail.radius
    value: str | None  # as written
    message: str       # what is wrong, and what is allowed
    text: str          # all of that, as `ballast check` prints it

    @property
    def allowed(self) -> str | None:
        """The allowed values; None where the message does not say."""
        _, found, allowed = self.message.partition("allowed: ")
        return allowed if found else None


class BallastError(Exception):
    """Base of this package's exceptions."""


class ScenarioError(BallastError, ValueError):
    """A scenario has errors.

    str() lists all of them, one a line, as `ballast check` does. `findings` holds them apart; `file`, `line`, `key`,
    `value`, `message` and `allowed` are those of the first (see Finding).
    """

    def __init__(self, findings: Sequence[tuple]):
        self.findings = tuple(Finding(*finding) for finding in findings)
        first = self.findings[0]
        self.file, self.line, self.key, self.value, self.message = first[:5]
        self.allowed = first.allowed
        super().__init__(self.findings)

    def __str__(self) -> str:
        return "\n".join(finding.text for finding in self.findings)


class RunError(BallastError, RuntimeError):
    """Something could not be done: a folder, a file, a bus, a lost peer. The words are the command's."""


class RunWarning(UserWarning):
    """A run came to its end with a warning: lost steps, a large log."""
