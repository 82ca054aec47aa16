"""The examples of docs/testing.md, as they stand there."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

from helpers.patience import PATIENCE
from helpers.real_rig import PROJECT

GUIDE = (PROJECT / "docs" / "testing.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)


def run(folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", *arguments], cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode == 1, "one rule is broken" + done.stdout + done.stderr
    return done.stdout


def test_the_example_fails_as_the_guide_says_and_passes_when_it_is_mended(tmp_path: Path) -> None:
    for block in blocks("python"):
        (tmp_path / block.partition("\n")[0].removeprefix("# ")).write_text(block)
    failed, sentence = blocks("text")[0].splitlines()
    (command,) = blocks("sh")
    by_file = run(tmp_path, "pytest", "test_my_damper.py")
    assert failed in by_file
    assert by_file.count(sentence) >= 1
    assert "1 failed, " in by_file
    assert sentence in run(tmp_path, *shlex.split(command)[2:])

    law = (tmp_path / "my_damper.py").read_text()
    mended = re.search(r"Write `(.*?)`", GUIDE)
    assert mended is not None
    slip = "error = reference.force\n        error -= state.force\n"
    assert slip in law
    (tmp_path / "my_damper.py").write_text(law.replace(slip, f"{mended[1]}\n"))
    done = subprocess.run([sys.executable, "-m", "pytest", "-q"], cwd=tmp_path, timeout=PATIENCE, check=False)
    assert done.returncode == 0
