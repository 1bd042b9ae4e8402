"""python_tests.py SCRIPT [option of unittest]...: runs the unittest tests of a script.

Exit status 0 only if at least one test ran, none failed and none was skipped: a skipped test proves nothing.
"""
import importlib
import pathlib
import sys
import unittest


def main():
    script = pathlib.Path(sys.argv[1]).resolve()
    sys.path.insert(0, str(script.parent))
    module = importlib.import_module(script.stem)
    result = unittest.main(module, argv=[str(script), *sys.argv[2:]], exit=False).result
    for test, reason in result.skipped:
        print(f"SKIPPED, which counts as failed: {test}: {reason}", file=sys.stderr)
    return 0 if result.testsRun > 0 and result.wasSuccessful() and not result.skipped else 1


if __name__ == "__main__":
    sys.exit(main())
