"""The rules from the command line, as in `python -m hilrig.testing controllers ./my_controller.py`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hilrig.core.errors import HilrigError, PluginError, nearest
from hilrig.experiment.document import parse
from hilrig.kinds.registry import PROTOCOLS, is_path, kind_names
from hilrig.testing.collected import run
from hilrig.testing.contract import choose

USAGE = f"""python -m hilrig.testing GROUP KIND [KIND ...] [FIELD=VALUE ...] [OPTION ...]

Tests whether kinds keep the rules of their group, one test for each rule.

GROUP        {", ".join(PROTOCOLS)}
KIND         a kind of the group, or a path such as ./my_controller.py
FIELD=VALUE  a value to test with, as in an experiment file: force=0.5, stiffness="3 N/m", robot="{{kind: ./mine.py}}";
             a field without a default may need one
OPTION       of pytest, such as -x, -q, -k memory or --junit-xml=FILE

docs/testing.md shows the same as a test file of two lines."""


def main(arguments: Sequence[str]) -> int:
    """Run the rules and return pytest's exit code. Raises HilrigError if the command line is wrong."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(USAGE)
        return 0 if arguments else 2
    group, *rest = arguments
    if group not in PROTOCOLS:
        raise PluginError(f"there is no group '{group}'{nearest(group, PROTOCOLS)} (groups: {', '.join(PROTOCOLS)})")
    first = next((i for i, word in enumerate(rest) if word.startswith("-")), len(rest))
    words, options = rest[:first], rest[first:]
    names, values = _kinds(group, words), _values(words)
    try:
        kinds = choose(Path.cwd(), group, names, values)
    except (TypeError, ValueError) as error:
        raise PluginError(str(error)) from error
    return run(kinds, options)


def _kinds(group: str, words: Sequence[str]) -> list[str]:
    """Return the words that are kinds. Raises PluginError if there are none, or for a word that is nothing."""
    names = [word for word in words if not _is_value(word)]
    known = kind_names(group)
    if not names:
        raise PluginError(f"name a kind of {group} ({', '.join(known)}), or a file such as ./mine.py")
    for name in names:
        if is_path(name) and not Path(name).is_file():
            raise PluginError(f"there is no file {name}")
        if not is_path(name) and name not in known:
            raise PluginError(
                f"'{name}' is no kind of {group}{nearest(name, known)} (known: {', '.join(known) or 'none'}), "
                "no file such as ./mine.py and no FIELD=VALUE; options of pytest come last"
            )
    return names


def _values(words: Sequence[str]) -> dict[str, Any]:
    """Return the values by field, each from YAML. Raises ExperimentError for one that is not YAML."""
    pairs = [word.split("=", 1) for word in words if _is_value(word)]
    return {name: parse(text, f"{name}={text}").data for name, text in pairs}


def _is_value(word: str) -> bool:
    name, given, _ = word.partition("=")
    return bool(given) and name.isidentifier()


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except HilrigError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
