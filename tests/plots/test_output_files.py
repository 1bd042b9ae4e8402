"""Output files appear whole or not at all and replace no other file, whatever their name and however full the disk."""

import os
import resource
import socket
import stat
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from output_files import Kind, OutputError, OutputFiles, check_place

KIND = Kind("test page", b"<test>")


class OutputFilesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def write(self, path, text="<test>new", inputs=()):
        with OutputFiles(path, inputs) as files:
            files.open(path, KIND, encoding="utf-8").write(text)

    def assert_refused(self, path, *said, inputs=()):
        before = self.seen()
        with self.assertRaises(OutputError) as refusal:
            self.write(path, inputs=inputs)
        for words in (str(path), "stays as it is; allowed: a new name", *said):
            self.assertIn(words, str(refusal.exception))
        self.assertEqual(self.seen(), before)

    def seen(self):
        return {path.name: (path.lstat().st_ino, path.lstat().st_mode,
                            path.read_bytes() if stat.S_ISREG(path.lstat().st_mode) else None)
                for path in self.folder.iterdir()}

    def test_a_new_file_an_empty_one_and_an_earlier_one_of_the_kind(self):
        path = self.folder / "page"
        for earlier in (None, "", "<test>old and longer than the new one"):
            if earlier is not None:
                path.write_text(earlier)
            self.write(path)
            self.assertEqual(path.read_text(), "<test>new")
            self.assertEqual([entry.name for entry in self.folder.iterdir()], ["page"])

    def test_the_mode_is_what_the_user_wants_of_new_files(self):
        for mask, mode in ((0o022, 0o644), (0o077, 0o600)):
            before = os.umask(mask)
            try:
                self.write(self.folder / f"{mode:o}")
            finally:
                os.umask(before)
            self.assertEqual(stat.S_IMODE((self.folder / f"{mode:o}").stat().st_mode), mode)

    def test_the_input_is_never_written_over_by_whatever_name(self):
        log = self.folder / "run.lcmlog"
        log.write_bytes(b"<test>it even looks like a page")
        os.link(log, self.folder / "hard")
        os.symlink(log, self.folder / "soft")
        for name in ("run.lcmlog", "hard", "soft", "../" + self.folder.name + "/run.lcmlog"):
            self.assert_refused(self.folder / name, "is an input of this program", inputs=[log])

    def test_everything_that_is_no_file_of_the_kind_is_refused(self):
        (self.folder / "scenario.toml").write_text("[ball]\n")
        (self.folder / "page").write_text("<test>")
        (self.folder / "folder").mkdir()
        os.symlink("page", self.folder / "link")
        os.symlink("nowhere", self.folder / "dangling")
        os.mkfifo(self.folder / "pipe")
        listener = socket.socket(socket.AF_UNIX)
        self.addCleanup(listener.close)
        listener.bind(str(self.folder / "socket"))
        for name, said in (("scenario.toml", "exists and is no test page"), ("folder", "is a folder"),
                           ("link", "is a symbolic link, to page"), ("dangling", "is a symbolic link, to nowhere"),
                           ("pipe", "is a device, a pipe or a socket"), ("socket", "is a device")):
            with self.subTest(name):
                self.assert_refused(self.folder / name, said)

    def test_a_device_is_refused(self):
        before = os.lstat("/dev/null")
        with self.assertRaisesRegex(OutputError, "/dev/null is a device"):
            check_place("/dev/null", KIND)
        self.assertEqual(os.lstat("/dev/null").st_rdev, before.st_rdev)

    def test_a_write_protected_file_is_refused(self):
        (self.folder / "page").write_text("<test>kept")
        (self.folder / "page").chmod(0o444)
        self.folder.chmod(0o755)
        if os.geteuid() == 0:  # root may write every file, so another user has to try
            os.setresuid(65534, 65534, 0)
            self.addCleanup(os.setresuid, 0, 0, 0)
        self.assert_refused(self.folder / "page", "is write-protected")

    def test_a_failure_half_way_leaves_what_was_there(self):
        (self.folder / "a").write_text("<test>old")
        before = self.seen()
        with self.assertRaises(KeyboardInterrupt), OutputFiles(self.folder) as files:
            files.open(self.folder / "a", KIND).write(b"<test>half")
            files.open(self.folder / "b", KIND).write(b"<test>half")
            raise KeyboardInterrupt
        self.assertEqual(self.seen(), before)

    def test_one_refused_file_keeps_back_all(self):
        (self.folder / "b").write_text("something else")
        before = self.seen()
        with self.assertRaises(OutputError), OutputFiles(self.folder) as files:
            files.open(self.folder / "a", KIND).write(b"<test>")
            files.open(self.folder / "b", KIND)
        self.assertEqual(self.seen(), before)

    def test_a_folder_that_is_not_there_is_named(self):
        with self.assertRaisesRegex(OutputError, "nowhere/page: No such file or directory"):
            self.write(self.folder / "nowhere/page")

    def test_a_full_disk_says_so_and_leaves_what_was_there(self):
        # A limit on the size of files fails the same write as a full disk, with another message. It would also cut off the
        # bytecode that Python caches, and every later import would fail: hence -B.
        (self.folder / "page").write_text("<test>old")
        before = self.seen()
        for size in (100, 5000000):  # found out when the file is closed, and in the midst of writing
            done = subprocess.run(
                [sys.executable, "-B", "-s", "-c", "import sys, test_output_files as t\n"
                 "from output_files import OutputFiles\n"
                 "with OutputFiles(sys.argv[1]) as files:\n"
                 "    files.open(sys.argv[1], t.KIND).write(b'x' * int(sys.argv[2]))",
                 str(self.folder / "page"), str(size)], cwd=Path(__file__).parent, capture_output=True, text=True,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64)), check=False)
            self.assertIn("OutputError", done.stderr)
            self.assertIn("page: cannot be written: File too large; nothing is kept", done.stderr)
            self.assertEqual(self.seen(), before)


if __name__ == "__main__":
    unittest.main()
