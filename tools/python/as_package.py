"""as_package.py OUT FILE...: copies modules that import each other by bare names into the package OUT.

In the copies these imports are relative, and `import ballast`, which to a script names the messages' classes, names the
package `_messages` beside OUT.
"""
import re
import sys
from pathlib import Path


def as_member(text, siblings):
    """The module's text with its imports as those of a member of the package."""
    names = "|".join(sorted(siblings))
    text = re.sub(rf"^(\s*)from ({names}) import ", r"\1from .\2 import ", text, flags=re.M)
    text = re.sub(rf"^(\s*)import ({names})$", r"\1from . import \2", text, flags=re.M)
    return re.sub(r"^(\s*)import ballast$", r"\1from .. import _messages as ballast", text, flags=re.M)


def main():
    out, files = Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]]
    out.mkdir(parents=True, exist_ok=True)
    siblings = {file.stem for file in files}
    for stale in out.glob("*.py"):
        if stale.stem not in siblings:
            stale.unlink()
    for file in files:
        (out / file.name).write_text(as_member(file.read_text(), siblings))
    (out / "__init__.py").write_text('"""The pictures of ballast-plot: copies of tools/plots."""\n')


if __name__ == "__main__":
    main()
