"""The provenance of a run: commit, versions, machine."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from hilrig import __version__
from hilrig.recording.repository import repository

PACKAGES = ("eclipse-zenoh", "numba", "numpy", "pybullet", "scipy", "mcap", "pandas", "matplotlib")


def provenance(experiment: Path) -> dict[str, Any]:
    """Return the manifest's entries about code and machine; unknown values are None.

    The commit is that of the repository that contains the experiment file.
    """
    return {"hilrig": __version__, **repository(experiment.parent), **_software(), "host": _host()}


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
