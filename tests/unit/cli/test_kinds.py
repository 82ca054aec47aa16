from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from helpers.packages import install


def kinds(folder: Path, *arguments: str) -> str:
    """Return what `hilrig kinds` prints where the packages in `folder` are installed, too."""
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "hilrig", "kinds", *arguments]
    return subprocess.run(
        command, env={**os.environ, "PYTHONPATH": path}, check=True, capture_output=True, text=True
    ).stdout


def test_a_kind_that_cannot_be_loaded_is_listed_with_the_reason_among_the_others(tmp_path: Path) -> None:
    (tmp_path / "theirs.py").write_text("import no_such_engine\n")
    install(tmp_path, "controllers", "theirs = theirs")
    lines = dict(line.split(maxsplit=1) for line in kinds(tmp_path, "controllers").splitlines())
    reason = "cannot be loaded: the kind 'theirs' of controllers cannot be imported: ModuleNotFoundError"
    assert lines["theirs"].startswith(reason)
    assert "pd" in lines
    assert "theirs" in kinds(tmp_path)


def test_a_key_of_the_file_is_described_like_a_kind(tmp_path: Path) -> None:
    """With units, bounds and defaults: the safety limits among them."""
    assert "keys          task, safety, rig, timing" in kinds(tmp_path)
    rows = {line.split()[0]: line.split() for line in kinds(tmp_path, "safety").splitlines() if line.strip()}
    assert rows["tip_force"][1:5] == ["N", "200", "0.001", "100000"]
    assert {"torque_rate", "workspace", "command_age", "start_tolerance"} <= set(rows)
    assert "law_memory" in kinds(tmp_path, "rig")
