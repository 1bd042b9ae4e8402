"""The page tools/docs/python.md and the examples: every block of Python runs, and shows what it says."""
import ast
import contextlib
import doctest
import os
import pathlib
import pydoc
import re
import runpy
import tempfile
import unittest

import ballast

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "tools/docs/python.md"


class Page(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(folder.name)

    def test_the_examples_show_what_the_page_says(self):
        blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.M | re.S)
        self.assertGreater(len(blocks), 4)
        test = doctest.DocTestParser().get_doctest("".join(blocks), {}, "python.md", str(PAGE), 0)
        report = []
        failed, tried = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, out=report.append)
        self.assertEqual(failed, 0, "".join(report))
        self.assertGreater(tried, 15)

    def test_the_scripts_run(self):
        for script in sorted((ROOT / "tools/python/examples").glob("*.py")):
            with self.subTest(script.name), contextlib.redirect_stdout(None):
                runpy.run_path(str(script), run_name="__main__")
        self.assertTrue(pathlib.Path("friction.png").read_bytes().startswith(b"\x89PNG"))

    def test_the_stub_names_what_the_module_has(self):
        stub = ast.parse((ROOT / "tools/python/ballast/_core.pyi").read_text())
        named = {node.target.id if isinstance(node, ast.AnnAssign) else node.name: node for node in stub.body
                 if isinstance(node, (ast.AnnAssign, ast.FunctionDef, ast.ClassDef))}
        self.assertEqual(set(named), {name for name in vars(ballast._core) if not name.startswith("__")})
        for name, node in named.items():
            if isinstance(node, ast.ClassDef):
                members = {part.target.id if isinstance(part, ast.AnnAssign) else part.name for part in node.body}
                has = {member for member in vars(getattr(ballast._core, name)) if not member.startswith("_")}
                self.assertEqual(members - {"__init__"}, has, name)

    def test_everything_public_is_documented(self):
        page = PAGE.read_text()
        for name in ballast.__all__:
            value = getattr(ballast, name)
            if name.startswith("__"):
                continue
            self.assertTrue(value.__doc__, name)
            self.assertRegex(page, rf"(`|ballast\.){name}\b")
            for member, of in vars(value).items() if isinstance(value, type) else ():
                if not member.startswith("_") and (callable(of) or isinstance(of, (property, classmethod))):
                    self.assertTrue(getattr(value, member).__doc__, f"{name}.{member}")
        self.assertIn("Ctrl-C ends the run", pydoc.render_doc(ballast.run))

    def test_objects_say_what_they_are(self):
        plant, channels = ballast.Plant("paper_ball"), ballast.run(ballast.Scenario("paper_ball").set("duration", 0.01)).channels
        self.assertEqual(repr(plant), "<ballast.Plant with 3 masses: rolling at t = 0 s>")
        self.assertRegex(repr(channels), "^<channels contact, ")
        self.assertIn("contact", channels._ipython_key_completions_())  # pylint: disable=protected-access


if __name__ == "__main__":
    unittest.main()
