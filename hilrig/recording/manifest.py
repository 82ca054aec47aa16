"""Where a run comes from: commit, versions, machine, command."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any

from hilrig import __version__

PACKAGES = ("eclipse-zenoh", "numba", "numpy", "pybullet", "scipy", "mcap", "pandas", "matplotlib")
LARGEST_DIFF = 200_000


def provenance(experiment: Path) -> dict[str, Any]:
    """Return what the manifest says of code and machine; what is not known is None.

    The commit is that of the experiment's repository.
    """
    return {"hilrig": __version__, **_repository(experiment.parent), **_software(), "host": _host()}


def _repository(folder: Path) -> dict[str, Any]:
    commit = _git(folder, "rev-parse", "HEAD")
    if commit is None:
        return {"commit": None, "dirty": None, "diff": None}
    diff, status = _git(folder, "diff", "HEAD"), _git(folder, "status", "--porcelain")
    if diff is not None and len(diff) > LARGEST_DIFF:
        diff = diff[:LARGEST_DIFF] + "\n[the rest of the diff is left out]\n"
    return {"commit": commit.strip(), "dirty": None if status is None else bool(status.strip()), "diff": diff}


def _git(folder: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(["git", "-C", str(folder), *arguments], capture_output=True, text=True, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout if done.returncode == 0 else None


def _software() -> dict[str, Any]:
    versions: dict[str, str] = {}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return {"versions": versions, "python": platform.python_version()}


def _host() -> dict[str, Any]:
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {
        "node": platform.node(),
        "system": f"{platform.system()} {platform.release()}",
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "memory_gib": round(memory / 2**30, 1),
    }


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
