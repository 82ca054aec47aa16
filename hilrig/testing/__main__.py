"""The rules from the command line, as in `python -m hilrig.testing controllers ./my_controller.py`."""

from __future__ import annotations

import ast
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest

from hilrig.core.errors import PluginError, nearest
from hilrig.kinds.registry import PROTOCOLS, is_path, kind_names

USAGE = f"""python -m hilrig.testing GROUP KIND [KIND ...] [FIELD=VALUE ...] [OPTION ...]

Tests whether kinds keep the rules of their group, one test for each rule.

GROUP        {", ".join(PROTOCOLS)}
KIND         a kind of the group, or a path such as ./my_controller.py
FIELD=VALUE  a value to test with, such as force=0.5; a field without a default may need one
OPTION       of pytest, such as -x, -q, -k memory or --junit-xml=FILE

docs/testing.md shows the same as a test file of two lines."""


def main(arguments: Sequence[str]) -> int:
    """Run the rules and return pytest's exit code. Raises PluginError if the command line is wrong."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(USAGE)
        return 0 if arguments else 2
    group, *rest = arguments
    if group not in PROTOCOLS:
        raise PluginError(f"there is no group '{group}'{nearest(group, PROTOCOLS)} (groups: {', '.join(PROTOCOLS)})")
    first = next((i for i, word in enumerate(rest) if word.startswith("-")), len(rest))
    words, options = rest[:first], rest[first:]
    if not any("=" not in word for word in words):
        raise PluginError(f"name a kind of {group} ({', '.join(kind_names(group))}), or a file such as ./mine.py")
    with tempfile.TemporaryDirectory() as folder:
        # The two lines that an author would write. Any pytest configuration in this folder is ignored.
        file, settings = Path(folder, f"test_{group}.py"), Path(folder, "pytest.ini")
        call = ", ".join([repr(group), *map(_argument, words)])
        file.write_text(f"from hilrig.testing import contract\n\ntest_contract = contract({call})\n", encoding="utf-8")
        settings.write_text("[pytest]\n", encoding="utf-8")
        place = ["-c", str(settings), "--rootdir", folder, "-p", "no:cacheprovider"]
        return int(pytest.main([*place, str(file), *options]))


def _argument(word: str) -> str:
    """Return a word of the command line as an argument of `contract`."""
    name, given, value = word.partition("=")
    if given and name.isidentifier():
        try:
            return f"{name}={ast.literal_eval(value)!r}"
        except (SyntaxError, ValueError):
            return f"{name}={value!r}"
    return repr(str(Path(word).resolve()) if is_path(word) else word)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except PluginError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
