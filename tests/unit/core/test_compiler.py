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
from hilrig.core.compiler import kernel
from hilrig.inner import factor

@kernel
def scaled(x):
    return factor(x) * 1.0

print(scaled(2.0), sum(scaled.stats.cache_hits.values()))
"""
INNER = """
from hilrig.core.compiler import kernel

@kernel
def factor(x):
    return {factor} * x
"""

COMPOSED = """
from hilrig.core.compiler import composed, kernel
from plant import advance

@kernel
def scale(x):
    return 10.0 * x

def within(x):
    return part(x)

def around(x):
    return first(second(x))

inner = composed(within, part=advance)
orders = [composed(around, first=inner, second=scale), composed(around, first=scale, second=inner),
          composed(around, second=inner, first=scale)]
assert orders[1] is orders[2], "asked again for the same"
print(*[f"{order(2.0):g}" for order in orders], sum(sum(order.stats.cache_hits.values()) for order in orders))
"""
PLAIN = """
from hilrig.core.compiler import can_be_composed, composed, jitable, kernel_without_arrays

@jitable
def ten():
    return 10.0

@kernel_without_arrays
def scale(x):
    return ten() * x

def within(x):
    return part(x)

def around(x):
    return 3.0 * part(x)

inner = composed(within, makes_arrays=False, part=scale)
outer = composed(around, part=inner)
assert can_be_composed(outer) and outer is composed(around, part=inner)
print(outer(2.0), int(outer is outer.py_func))
"""
PLANT = """
from hilrig.core.compiler import kernel
from numbers_only import OFFSET

@kernel
def advance(x):
    return x + {step} + OFFSET
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package named hilrig with the real compiler.py, what it needs, and little else."""
    root = tmp_path / "source"
    (root / "hilrig").mkdir(parents=True)
    (root / "hilrig" / "__init__.py").write_text("")
    (root / "hilrig" / "core").mkdir()
    for name in ("compiler.py", "errors.py", "__init__.py"):
        shutil.copy(Path(hilrig.__file__).parent / "core" / name, root / "hilrig" / "core")
    (root / "hilrig" / "inner.py").write_text(INNER.format(factor=3.0))
    (root / "user").mkdir()
    (root / "user" / "mine.py").write_text(USER)
    return root


def printed(package: Path, cache: Path, script: str, **variables: str) -> list[float]:
    """Return the numbers that a script of the user's prints, in a fresh process with these environment variables."""
    paths = os.pathsep.join([str(package), str(package / "plants")])
    environment = {**os.environ, "PYTHONPATH": paths, "HILRIG_CACHE_DIR": str(cache), **variables}
    command = [sys.executable, str(package / "user" / script)]
    done = subprocess.run(command, env=environment, cwd=package, capture_output=True, text=True, check=True)
    return [float(number) for number in done.stdout.split()]


def run(package: Path, cache: Path, **variables: str) -> tuple[float, int]:
    """Return the result of mine.py and the number of cache hits."""
    value, hits = printed(package, cache, "mine.py", **variables)
    return value, int(hits)


def test_kernels_are_kept_and_never_stale(package: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    assert run(package, cache) == (6.0, 0)
    assert run(package, cache) == (6.0, 1), "the second process loads what the first compiled"
    (package / "hilrig" / "inner.py").write_text(INNER.format(factor=5.0))
    assert run(package, cache) == (10.0, 0), "a kernel in another file changed"


def test_what_is_composed_is_kept_and_never_stale(package: Path, tmp_path: Path) -> None:
    """The template, a part, and a part's part in three folders, as a trial has them; the last one changes."""
    (package / "plants").mkdir()
    plant, numbers = package / "plants" / "plant.py", package / "plants" / "numbers_only.py"
    (package / "user" / "composition.py").write_text(COMPOSED)
    plant.write_text(PLANT.format(step=1.0))
    numbers.write_text("OFFSET = 0.0")
    cache = tmp_path / "cache"
    assert printed(package, cache, "composition.py") == [21.0, 30.0, 30.0, 0]
    assert printed(package, cache, "composition.py") == [21.0, 30.0, 30.0, 3]
    plant.write_text(PLANT.format(step=2.0))
    assert printed(package, cache, "composition.py") == [22.0, 40.0, 40.0, 0], "a part of a part changed"
    numbers.write_text("OFFSET = 5.0")
    assert printed(package, cache, "composition.py") == [27.0, 90.0, 90.0, 0], "a number that a part takes changed"


def test_a_cache_that_cannot_be_written_is_refused_by_name(package: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(subprocess.CalledProcessError) as caught:
        run(package, tmp_path / "file" / "cache")
    assert "Not a directory; set HILRIG_CACHE_DIR to a writable folder" in caught.value.stderr


def test_a_setting_that_changes_the_code_has_a_cache_of_its_own(package: Path, tmp_path: Path) -> None:
    """Or one run with NUMBA_OPT=1 would slow down all that come after it."""
    cache = tmp_path / "cache"
    assert run(package, cache, NUMBA_OPT="1") == (6.0, 0)
    assert run(package, cache) == (6.0, 0), "not the code of the run before"
    assert run(package, cache, NUMBA_OPT="1") == (6.0, 1)
    assert run(package, cache) == (6.0, 1)


def test_where_numba_is_told_to_keep_its_own_does_not_matter(package: Path, tmp_path: Path) -> None:
    cache, other = tmp_path / "cache", tmp_path / "other"
    settings = {"NUMBA_CACHE_DIR": str(other), "NUMBA_CACHE_LOCATOR_CLASSES": "InTreeCacheLocator"}
    assert run(package, cache, **settings) == (6.0, 0)
    assert run(package, cache) == (6.0, 1)
    assert not other.exists()
    assert list(package.rglob("*.nbi")) == []


def test_without_compilation_kernels_are_the_python_functions_that_they_are(package: Path, tmp_path: Path) -> None:
    (package / "user" / "plain.py").write_text(PLAIN)
    cache = tmp_path / "cache"
    assert printed(package, cache, "plain.py", NUMBA_DISABLE_JIT="1") == [60.0, 1]
    assert not cache.exists()
    assert printed(package, cache, "plain.py", NUMBA_DISABLE_JIT="0") == [60.0, 0]


def test_a_file_in_a_folder_that_is_not_utf_8_is_compiled(package: Path, tmp_path: Path) -> None:
    """numba would name what it keeps after the folder, and cannot: the kernel is compiled in each process."""
    folder = os.fsdecode(os.fsencode(package) + b"/u\xff")
    os.rename(package / "user", folder)
    for _ in range(2):
        environment = {**os.environ, "PYTHONPATH": str(package), "HILRIG_CACHE_DIR": str(tmp_path / "cache")}
        command = [sys.executable, os.path.join(folder, "mine.py")]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        assert done.stdout == "6.0 0\n", done.stderr


def test_settings_that_numba_cannot_read_are_named(package: Path, tmp_path: Path) -> None:
    (package / "yaml.py").write_text("def safe_load(file):\n    raise ValueError('line 1: not YAML')\n")
    (package / ".numba_config.yaml").write_text(":")
    with pytest.raises(subprocess.CalledProcessError) as caught:
        run(package, tmp_path / "cache")
    assert (
        f"numba cannot read its settings: line 1: not YAML; check {package}/.numba_config.yaml" in caught.value.stderr
    )
