"""Fixtures for all tests: one that fails a test which leaves a process, a thread or a socket folder behind."""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

import pytest
from helpers.patience import LEAVING, came_true
from hypothesis import settings

# The first call of a kernel compiles it: an example may take seconds.
settings.register_profile("hilrig", deadline=None)
settings.load_profile("hilrig")


def pytest_collection_modifyitems(items: Sequence[pytest.Item]) -> None:
    """Skip the tests marked `needs_pybullet` where PyBullet is not installed; `-ra` lists them."""
    if find_spec("pybullet") is None:
        skip = pytest.mark.skip(reason="needs PyBullet, which has no wheels for Python 3.12 and newer")
        for item in items:
            if item.get_closest_marker("needs_pybullet"):
                item.add_marker(skip)


@pytest.fixture(scope="session", autouse=True)
def temporary_root() -> Iterator[Path]:
    """Give this session a temporary folder of its own, inherited by its children; its name marks what they leave."""
    before = os.environ.get("TMPDIR")
    root = Path(tempfile.mkdtemp(prefix="ht-"))
    os.environ["TMPDIR"], tempfile.tempdir = str(root), None
    yield root
    if before is None:
        del os.environ["TMPDIR"]
    else:
        os.environ["TMPDIR"] = before
    tempfile.tempdir = None
    shutil.rmtree(root, ignore_errors=True)


@pytest.fixture(autouse=True)
def nothing_left_behind(temporary_root: Path) -> Iterator[None]:
    """Fail a test after which there are processes, threads or socket folders that were not there before."""
    before = leftovers(temporary_root).keys()
    yield
    came_true(lambda: not leftovers(temporary_root).keys() - before, LEAVING)
    left = leftovers(temporary_root)
    assert left.keys() <= before, f"left behind: {', '.join(left[item] for item in sorted(left.keys() - before))}"


def leftovers(root: Path) -> dict[str, str]:
    """Return every living thread, child process, process of the rig, and socket folder: a name of its own -> words."""
    threads = {f"thread {thread.ident}": f"thread {thread.name}" for thread in threading.enumerate()}
    sockets = {f"folder {path}": f"folder {path}" for path in root.glob("hilrig-*")}
    return {**threads, **sockets, **dict(_processes(root))}


def _processes(root: Path) -> Iterator[tuple[str, str]]:
    """Children of this process, and processes anywhere that were told of this session's temporary folder."""
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
        except OSError:
            continue  # gone in the meantime
        helper = "multiprocessing.resource_tracker" in command  # lives as long as this process, by design
        if not helper and (parent == os.getpid() or str(root) in command):
            yield f"process {entry.name}", f"process {entry.name} ({command[:120]})"
