"""Every relative link in the project's pages leads somewhere: to a file or folder that exists, and to a heading of it."""
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^()\s]+)\)")
CODE = re.compile(r"^(```|~~~).*?^\1", re.M | re.S)


def pages():
    """The pages in the tree, without those of build folders and of runs."""
    outside = re.compile(r"^(build|runs|\.git)")
    for path in sorted(ROOT.rglob("*.md")):
        if not outside.match(path.relative_to(ROOT).parts[0]):
            yield path


def prose(text):
    """The text without blocks and spans of code."""
    return re.sub(r"`[^`\n]*`", "", CODE.sub("", text))


def anchors(text):
    """The names that GitHub gives to the headings of a page."""
    found = set()
    for heading in re.findall(r"^#{1,6} +(.*?) *#*$", CODE.sub("", text), re.M):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        name = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        number = 0
        while (name if number == 0 else f"{name}-{number}") in found:
            number += 1
        found.add(name if number == 0 else f"{name}-{number}")
    return found


def broken_links(page, text):
    """The links of one page that lead nowhere, each with the reason."""
    for link in LINK.findall(prose(text)):
        if re.match(r"[a-z]+:", link):
            continue
        target, _, anchor = link.partition("#")
        path = (page.parent / target).resolve() if target else page
        name = page.relative_to(ROOT)
        if not path.exists():
            yield f"{name}: {link}: no such file"
        elif not path.is_relative_to(ROOT):
            yield f"{name}: {link}: outside the project"
        elif anchor and anchor not in anchors(path.read_text()):
            yield f"{name}: {link}: no such heading"


class Links(unittest.TestCase):
    def test_every_relative_link_resolves(self):
        broken = [found for page in pages() for found in broken_links(page, page.read_text())]
        self.assertEqual(broken, [])

    def test_the_first_page_stays_short(self):
        self.assertLessEqual((ROOT / "README.md").stat().st_size, 10_000)

    def test_every_page_of_tools_docs_is_listed(self):
        listed = (ROOT / "tools/docs/README.md").read_text()
        for page in sorted((ROOT / "tools/docs").glob("*.md")):
            self.assertTrue(page.name == "README.md" or f"({page.name})" in listed, page.name)

    def test_a_broken_link_is_found(self):
        page = ROOT / "README.md"
        self.assertEqual(len(list(broken_links(page, "[a](no/such.md) [b](LICENSE) `[c](code)`"))), 1)
        self.assertEqual(len(list(broken_links(page, "# A heading, `with code`\n[a](README.md#no-such-heading)"))), 1)
        self.assertEqual(anchors("# A heading, `with code`\n# A heading, with code"),
                         {"a-heading-with-code", "a-heading-with-code-1"})


if __name__ == "__main__":
    unittest.main()
