"""Packages: only what the lock file names is used, and what cannot be had is said with what to do."""

import base64
import hashlib
import http.server
import io
import json
import os
import tarfile
import tempfile
import threading
import unittest
from pathlib import Path
from unittest import mock

import packages
from packages import Package, PackageError

TEXT = "export const answer = 42;\n"


def archive(text=TEXT):
    """An npm archive with one file."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as tar:
        entry = tarfile.TarInfo("package/index.js")
        entry.size = len(text)
        tar.addfile(entry, io.BytesIO(text.encode()))
    return buffer.getvalue()


class Registry:
    """Answers every request with `answer`, on this machine alone; `asked` are the paths."""

    def __init__(self, answer):
        registry = self
        self.asked = []

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                registry.asked.append(self.path)
                self.send_response(200)
                self.end_headers()
                self.wfile.write(answer)

            def log_message(self, *_):
                pass

        self.server = http.server.HTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def close(self):
        self.server.shutdown()
        self.server.server_close()


class PackagesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.kept = self.folder / "kept" / "thing-1.2.3.tgz"

    def lock(self, whole):
        """A lock file that names the archive `whole`."""
        integrity = "sha512-" + base64.b64encode(hashlib.sha512(whole).digest()).decode()
        path = self.folder / "package-lock.json"
        path.write_text(json.dumps({"packages": {"node_modules/thing": {
            "version": "1.2.3", "resolved": "https://registry.npmjs.org/thing/-/thing-1.2.3.tgz",
            "integrity": integrity, "license": "MIT"}}}))
        return path

    def package(self, registry_url, whole=None):
        """With a proxy in the environment this machine's own registry would not be asked."""
        environment = {"BALLAST_PACKAGES": str(self.kept.parent), "npm_config_registry": registry_url, "no_proxy": "*"}
        with mock.patch.object(packages, "_LOCK_FILE", self.lock(whole or archive())), \
             mock.patch.dict(os.environ, environment):
            return Package("thing")

    def registry(self, answer):
        registry = Registry(answer)
        self.addCleanup(registry.close)
        return registry

    def test_fetched_once_then_kept(self):
        whole = archive()
        registry = self.registry(whole)
        for _ in range(2):
            self.assertEqual(self.package(registry.url + "/", whole).text("index.js"), TEXT)
        self.assertEqual(registry.asked, ["/thing/-/thing-1.2.3.tgz"])
        self.assertEqual(self.kept.read_bytes(), whole)
        self.assertEqual(list(self.kept.parent.iterdir()), [self.kept])

    def test_another_archive_is_not_used(self):
        registry = self.registry(archive("steal();\n"))
        with self.assertRaisesRegex(PackageError, "thing-1.2.3.tgz: the download.s sha512 is not"):
            self.package(registry.url)
        self.assertFalse(self.kept.exists())

    def test_a_changed_file_is_not_used(self):
        self.kept.parent.mkdir()
        self.kept.write_bytes(archive("steal();\n"))
        with self.assertRaisesRegex(PackageError, "remove the file"):
            self.package("http://127.0.0.1:9")

    def test_without_a_network_it_says_what_to_do(self):
        registry = Registry(b"")
        registry.close()  # nobody answers at this port any more
        with self.assertRaises(PackageError) as caught:
            self.package(registry.url)
        for said in ("thing 1.2.3", f"{registry.url}/thing/-/thing-1.2.3.tgz", "refused", str(self.kept)):
            self.assertIn(said, str(caught.exception))

    def test_the_lock_file_pins_what_the_page_uses(self):
        here = Path(packages.__file__).parent
        wanted = json.loads((here / "package.json").read_text())["dependencies"]
        locked = json.loads((here / "package-lock.json").read_text())["packages"]
        for name, version in wanted.items():
            self.assertEqual(locked[f"node_modules/{name}"]["version"], version)
            self.assertRegex(locked[f"node_modules/{name}"]["integrity"], "^sha512-")
            self.assertIn("Copyright", Package(name).text("LICENSE"))


if __name__ == "__main__":
    unittest.main()
