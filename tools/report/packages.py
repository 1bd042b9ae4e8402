"""npm packages, in exactly the versions of a package-lock.json, downloaded once: those that the page draws with.

Node and npm are not needed. The registry's archive of a package is kept in the folder BALLAST_PACKAGES (in the build
tree, set by tools/plots/python-tool.in). Its checksum is compared with the lock file's whenever it is used.
`npm_config_registry` names another registry, as for npm.
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
    """A package is not available. The message names it, its source and what to do."""


class Package:
    """A package. `text(path)` is a file in it, with paths relative to the archive's only folder, `package/`."""

    def __init__(self, name, lock_file=None):
        lock_file = lock_file or _LOCK_FILE
        entry = json.loads(lock_file.read_text(encoding="utf-8"))["packages"][f"node_modules/{name}"]
        self.name, self.version, self.license = name, entry["version"], entry["license"]
        archive = _archive(name, entry, lock_file)
        self._tar = tarfile.open(fileobj=io.BytesIO(archive), mode="r:gz")

    def text(self, path):
        return self._tar.extractfile(f"package/{path}").read().decode("utf-8")

    def files(self):
        """(path, bytes) of every file, with paths as of `text`."""
        for entry in self._tar:
            if entry.isfile():
                yield entry.name.split("/", 1)[1], self._tar.extractfile(entry).read()


def _archive(name, entry, lock_file):
    folder = os.environ.get("BALLAST_PACKAGES")
    if not folder:
        raise PackageError("BALLAST_PACKAGES is not set: it names the folder for packages; build/bin/ballast sets it")
    path = Path(folder) / f"{name}-{entry['version']}.tgz"
    try:
        archive = path.read_bytes()
    except FileNotFoundError:
        return _fetch(name, entry, path, lock_file)
    except OSError as error:
        raise PackageError(f"{path}: {error.strerror}") from error
    if not _is_whole(archive, entry):
        raise PackageError(f"{path}: its sha512 is not that of {lock_file}; remove the file, and it is fetched again")
    return archive


def _is_whole(archive, entry):
    algorithm, expected = entry["integrity"].split("-", 1)
    return hashlib.new(algorithm, archive).digest() == base64.b64decode(expected)


def _fetch(name, entry, path, lock_file):
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
            f"{name} {entry['version']} cannot be fetched from {url}: {why}\n"
            f"It is needed once. Try again with a network, or download that file elsewhere and put it here: {path}"
        ) from error
    if not _is_whole(archive, entry):
        raise PackageError(f"{url}: the download's sha512 is not that of {lock_file}; it is not used")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # The rename makes the file appear complete, since two reports may be made at once.
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
