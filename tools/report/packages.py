"""The npm packages the page draws with: fetched once, exactly those that package-lock.json names.

Node and npm are not needed. A package is kept as the archive the registry gave, in the folder BALLAST_PACKAGES (the
build tree's, set by tools/plots/python-tool.in), and held against the lock file's integrity every time it is used.
`npm_config_registry` names another registry, as it does for npm.
"""

import base64
import hashlib
import http.client
import io
import json
import os
import tarfile
import tempfile
import urllib.error
import urllib.request
from pathlib import Path

_LOCK_FILE = Path(__file__).resolve().parent / "package-lock.json"
_PUBLIC_REGISTRY = "https://registry.npmjs.org/"
_TIMEOUT_S = 60


class PackageError(Exception):
    """A package cannot be had; the message says which, from where, and what to do."""


class Package:
    """`text(path)`: a file of the package, paths as in its archive without the leading `package/`."""

    def __init__(self, name):
        entry = json.loads(_LOCK_FILE.read_text(encoding="utf-8"))["packages"][f"node_modules/{name}"]
        self.name, self.version, self.license = name, entry["version"], entry["license"]
        archive = _archive(name, entry)
        self._tar = tarfile.open(fileobj=io.BytesIO(archive), mode="r:gz")

    def text(self, path):
        return self._tar.extractfile(f"package/{path}").read().decode("utf-8")


def _archive(name, entry):
    folder = os.environ.get("BALLAST_PACKAGES")
    if not folder:
        raise PackageError("BALLAST_PACKAGES is not set: it names the folder for packages; build/bin/ballast sets it")
    path = Path(folder) / f"{name}-{entry['version']}.tgz"
    try:
        archive = path.read_bytes()
    except FileNotFoundError:
        return _fetch(name, entry, path)
    except OSError as error:
        raise PackageError(f"{path}: {error.strerror}") from error
    if not _is_whole(archive, entry):
        raise PackageError(f"{path}: its sha512 is not that of {_LOCK_FILE}; remove the file, and it is fetched again")
    return archive


def _is_whole(archive, entry):
    algorithm, expected = entry["integrity"].split("-", 1)
    return hashlib.new(algorithm, archive).digest() == base64.b64decode(expected)


def _fetch(name, entry, path):
    url = entry["resolved"]
    registry = os.environ.get("npm_config_registry")
    if registry:
        url = registry.rstrip("/") + "/" + url.removeprefix(_PUBLIC_REGISTRY)
    try:
        with urllib.request.urlopen(url, timeout=_TIMEOUT_S) as answer:
            archive = answer.read()
    except (OSError, http.client.HTTPException, ValueError) as error:
        why = getattr(error, "reason", None) or error
        raise PackageError(
            f"{name} {entry['version']}, with which the page draws, cannot be fetched from {url}: {why}\n"
            f"It is needed once. Try again with a network, or put that file, fetched elsewhere, in its place: {path}"
        ) from error
    if not _is_whole(archive, entry):
        raise PackageError(f"{url}: what came has another sha512 than {_LOCK_FILE} says; it is not used")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Whole or not at all: two reports may be made at once.
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as part:
            try:
                part.write(archive)
                part.flush()
                os.chmod(part.name, 0o644)
                os.replace(part.name, path)
            except BaseException:
                os.unlink(part.name)
                raise
    except OSError as error:
        raise PackageError(f"{path}: cannot be written: {error.strerror}") from error
    return archive
