"""Compiled kernels are kept between processes, and thrown away when any source they can call has changed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import hilrig

USER = """
import sys
from hilrig.kernel import kernel
from hilrig.inner import factor

@kernel
def scaled(x):
    return factor(x) * 1.0

print(scaled(2.0), sum(scaled.stats.cache_hits.values()))
"""
INNER = """
from hilrig.kernel import kernel

@kernel
def factor(x):
    return {factor} * x
"""

COMPOSED = """
import sys
sys.path.insert(0, {parts!r})
from part import factor
from hilrig.kernel import composed

part, inner = None, None

def middle(x):
    return part(x) + 1.0

def outer(x):
    return inner(x) * 2.0

whole = composed(outer, inner=composed(middle, part=factor))
print(whole(2.0), sum(whole.stats.cache_hits.values()))
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package named hilrig with the real kernel.py, what it needs, and little else."""
    root = tmp_path / "source"
    (root / "hilrig").mkdir(parents=True)
    (root / "hilrig" / "__init__.py").write_text("")
    for name in ("kernel.py", "errors.py"):
        shutil.copy(Path(hilrig.__file__).parent / name, root / "hilrig")
    (root / "hilrig" / "inner.py").write_text(INNER.format(factor=3.0))
    (root / "user").mkdir()
    (root / "user" / "mine.py").write_text(USER)
    return root


def run(package: Path, cache: Path) -> tuple[float, int]:
    """Return the result and the number of cache hits, in a fresh process."""
    environment = {**os.environ, "PYTHONPATH": str(package), "HILRIG_CACHE_DIR": str(cache)}
    command = [sys.executable, str(package / "user" / "mine.py")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    value, hits = done.stdout.split()
    return float(value), int(hits)


def test_kernels_are_kept_and_never_stale(package: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    assert run(package, cache) == (6.0, 0)
    assert run(package, cache) == (6.0, 1), "the second process loads what the first compiled"
    (package / "hilrig" / "inner.py").write_text(INNER.format(factor=5.0))
    assert run(package, cache) == (10.0, 0), "a kernel in another file changed"


def test_compositions_are_kept_and_never_stale(package: Path, tmp_path: Path) -> None:
    """The part that changes is in a folder of its own, two compositions away from the one that is called."""
    cache, parts = tmp_path / "cache", tmp_path / "parts"
    parts.mkdir()
    (package / "user" / "mine.py").write_text(COMPOSED.format(parts=str(parts)))
    (parts / "part.py").write_text(INNER.format(factor=3.0))
    assert run(package, cache) == (14.0, 0)
    assert run(package, cache) == (14.0, 1)
    (parts / "part.py").write_text(INNER.format(factor=5.0))
    assert run(package, cache) == (22.0, 0)


def test_a_cache_that_cannot_be_written_is_refused_by_name(package: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(subprocess.CalledProcessError) as caught:
        run(package, tmp_path / "file" / "cache")
    assert "Not a directory; set HILRIG_CACHE_DIR to a folder that can be written" in caught.value.stderr
