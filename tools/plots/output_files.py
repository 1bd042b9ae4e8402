"""Output files: a program's files appear all together and complete, or not at all.

An output file may replace an earlier file of the same kind. Anything else at its path is kept and makes the program
fail: input files, devices, links, folders, files of other kinds.
"""

import os
import stat
import tempfile
from pathlib import Path
from typing import NamedTuple


class OutputError(Exception):
    """A file cannot be written. The message names the file, the reason and what is allowed."""


class Kind(NamedTuple):
    name: str      # "CSV table of ballast export"
    begins: bytes  # the first bytes of every file of this kind


# The first bytes of pictures, by the ending of their names.
PICTURE_BEGINNINGS = {"png": b"\x89PNG\r\n\x1a\n", "svg": b"<?xml", "pdf": b"%PDF"}


def check_place(path, kind, inputs=()):
    """Raises OutputError unless a file of this kind may be written there. An empty file may be replaced."""
    try:
        status = os.lstat(path)
    except FileNotFoundError:
        return
    what = None
    if any(_same_file(path, other) for other in inputs):
        what = "is an input of this program"
    elif stat.S_ISLNK(status.st_mode):
        what = f"is a symbolic link, to {os.readlink(path)}"
    elif stat.S_ISDIR(status.st_mode):
        what = "is a folder"
    elif not stat.S_ISREG(status.st_mode):
        what = "is a device, a pipe or a socket"
    elif not os.access(path, os.W_OK):
        what = "is write-protected"
    elif status.st_size > 0:
        with open(path, "rb") as file:
            if file.read(len(kind.begins)) != kind.begins:
                what = f"exists and is no {kind.name}"
    if what is not None:
        raise OutputError(f"{path} {what}: it stays as it is; allowed: a new name, or an earlier {kind.name}")


def _same_file(path, other):
    try:
        return os.path.samefile(path, other)
    except OSError:
        return False  # one of them does not exist


class OutputFiles:
    """A context manager. Files opened in it appear when it ends without an exception; otherwise they are removed.

    `inputs` are the files that the program reads. `place` is named in an error that does not name a file itself.
    """

    def __init__(self, place, inputs=()):
        self._place, self._inputs, self._open = place, inputs, []

    def open(self, path, kind, encoding=None):
        """Opens a file for writing, binary unless `encoding` is given. It gets its name when the context ends."""
        path = Path(path)
        check_place(path, kind, self._inputs)
        try:
            handle, part = tempfile.mkstemp(prefix=".", suffix=".part", dir=path.parent)
        except OSError as error:
            raise OutputError(f"{path}: {error.strerror}") from error
        file = open(handle, "wb" if encoding is None else "w", encoding=encoding)
        self._open.append((file, part, path, kind))
        return file

    def __enter__(self):
        return self

    def __exit__(self, _, error, __):
        try:
            if error is None:
                self._finish()
            elif isinstance(error, OSError) and error.filename is None:
                self._fail(error)
        except OSError as late:
            self._fail(late)
        finally:
            self._discard()

    def _finish(self):
        for file, part, *_ in self._open:
            file.flush()
            os.fsync(file.fileno())  # some file systems report a full disk only now
            os.chmod(part, 0o666 & ~_umask())
            file.close()
        for _, _, path, kind in self._open:
            check_place(path, kind, self._inputs)
        for _, part, path, _ in self._open:
            os.replace(part, path)

    def _fail(self, error):
        raise OutputError(f"{self._place}: cannot be written: {error.strerror}; nothing is kept") from error

    def _discard(self):
        for file, part, *_ in self._open:
            try:
                file.close()
            except OSError:
                pass  # the file is removed anyway
            Path(part).unlink(missing_ok=True)


def _umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask
