"""The experiment files that come with hilrig, as parameters of tests."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

EXPERIMENTS = Path(__file__).parents[2] / "experiments"


def parameters(paths: Iterable[Path]) -> list[Any]:
    """Return one pytest parameter a file, marked if its driver needs PyBullet; its id is the path in experiments/."""
    return [pytest.param(path, id=str(path.relative_to(EXPERIMENTS)), marks=marks(path)) for path in sorted(paths)]


def marks(path: Path) -> list[pytest.MarkDecorator]:
    """Return the marks of a test that plans or runs the experiment in `path`."""
    return [pytest.mark.needs_pybullet] if "kind: pybullet_arm" in path.read_text(encoding="utf-8") else []
