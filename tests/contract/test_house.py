"""Rules of the house that a tool can check."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 300
"""Lines of a source file"""
ALONE = {"drivers/hilrig_drivers/bridge.py"}
"""Files that must hold everything: this one is run by the robot's interpreter, on its machine"""


def sources() -> list[Path]:
    return sorted(path for room in ("hilrig", "drivers", "benchmarks") for path in (ROOT / room).rglob("*.py"))


def tracked() -> list[str]:
    """Return the files that git tracks; skip the test outside a repository (a source archive)."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("not a git repository")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [name for name in listed.split("\0") if name]


def test_imports_keep_their_contracts() -> None:
    """The layers of pyproject.toml: a file that imports upwards fails here."""
    path = os.pathsep.join([str(ROOT), str(ROOT / "drivers"), os.environ.get("PYTHONPATH", "")])
    call = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports(no_cache=True))"
    done = subprocess.run(
        [sys.executable, "-c", call], cwd=ROOT, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


def test_source_files_stay_small() -> None:
    lengths = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in sources()}
    assert lengths
    assert {name for name, length in lengths.items() if length > LONGEST} == ALONE


def test_every_module_says_what_it_is_for() -> None:
    silent = [
        str(path.relative_to(ROOT))
        for path in sources()
        if not path.read_text(encoding="utf-8").lstrip().startswith('"""')
    ]
    assert silent == []


def test_nothing_is_tracked_that_is_made() -> None:
    endings, folders = (".mcap", ".bag", ".pyc", "uv.lock"), ("runs/", "dist/")
    assert [name for name in tracked() if name.endswith(endings) or name.startswith(folders)] == []
