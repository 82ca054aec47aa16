"""The examples of docs/testing.md, as they stand there."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

from helpers.guides import DOCS, blocks, write_files
from helpers.patience import PATIENCE

GUIDE = DOCS / "testing.md"


def run(folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", *arguments], cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode == 1, "one rule is broken" + done.stdout + done.stderr
    return done.stdout


def test_the_example_fails_as_the_guide_says_and_passes_when_it_is_mended(tmp_path: Path) -> None:
    assert write_files(GUIDE, tmp_path) == ["my_damper.py", "test_my_damper.py"]
    failed, sentence = blocks(GUIDE, "text")[0].splitlines()
    (command,) = blocks(GUIDE, "sh")
    words = shlex.split(command)
    assert words[:4] == ["uv", "run", "python", "-m"]
    by_file = run(tmp_path, "pytest", "test_my_damper.py")
    assert failed in by_file
    assert by_file.count(sentence) >= 1
    assert "1 failed, " in by_file
    assert sentence in run(tmp_path, *words[4:])

    law = (tmp_path / "my_damper.py").read_text()
    mended = re.search(r"Write `(.*?)`", GUIDE.read_text(encoding="utf-8"))
    assert mended is not None
    slip = "error = reference.force\n        error -= state.force\n"
    assert slip in law
    (tmp_path / "my_damper.py").write_text(law.replace(slip, f"{mended[1]}\n"))
    done = subprocess.run([sys.executable, "-m", "pytest", "-q"], cwd=tmp_path, timeout=PATIENCE, check=False)
    assert done.returncode == 0
