"""The verbs that only look load nothing that takes long to load."""

from __future__ import annotations

import subprocess
import sys

import pytest
from helpers.experiments import EXPERIMENTS

SLOW = {"matplotlib", "numba", "pandas", "scipy.linalg", "zenoh"}
"""Packages that take a quarter of a second or more to load, or that start threads"""

LOADED = """
import sys
from hilrig.cli.entry import main
try:
    main()
finally:
    print("loaded", *sys.modules)
"""


@pytest.mark.parametrize(
    ("arguments", "needed"),
    [
        (["list"], set()),
        (["show", "no_such_run"], set()),
        (["kinds"], set()),
        (["kinds", "drivers"], set()),
        (["check", str(EXPERIMENTS / "quickstart.yaml")], {"scipy.linalg"}),  # for the bounds of the proposed law
        (["plan", str(EXPERIMENTS / "my_controller.yaml")], set()),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_a_quick_verb_loads_nothing_slow(arguments: list[str], needed: set[str]) -> None:
    done = subprocess.run([sys.executable, "-c", LOADED, *arguments], capture_output=True, text=True, check=False)
    loaded = done.stdout.splitlines()[-1].split()
    assert loaded[0] == "loaded", done.stderr
    assert set(loaded) & SLOW == needed
