"""Foxglove's own JavaScript packages for tests, as npm/package-lock.json pins them. Needs node, but not npm."""

import json
import os
import shutil
import subprocess
from pathlib import Path

from packages import Package

_HERE = Path(__file__).resolve().parent
_LOCK_FILE = _HERE / "npm" / "package-lock.json"


def unpack(folder):
    """Unpacks all packages of the lock file into folder/node_modules."""
    for place in json.loads(_LOCK_FILE.read_text(encoding="utf-8"))["packages"]:
        if not place:
            continue  # the lock file's own entry
        for path, content in Package(place.removeprefix("node_modules/"), _LOCK_FILE).files():
            target = folder / place / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)


def node(folder, script, *arguments, **options):
    """Starts a script of npm/ with the packages in `folder`, into which it is copied: node looks for packages beside it."""
    copy = folder / script
    shutil.copy(_HERE / "npm" / script, copy)
    return subprocess.Popen(["node", copy, *map(str, arguments)], stdout=subprocess.PIPE, text=True,
                            env={**os.environ, "NODE_PATH": ""}, **options)


def output_of_node(folder, script, *arguments):
    with node(folder, script, *arguments) as process:
        text, _ = process.communicate(timeout=120)
    if process.returncode != 0:
        raise AssertionError(f"{script} ended with status {process.returncode}")
    return text
