"""cyclictest from rt-tests: how late this machine wakes a thread that does nothing else."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.placement import Placement
from hilrig.core.errors import RigError

LONGEST = 20_000
"""us of lateness that the histogram holds"""
LATE = 1000
"""us: a thread that wakes later than this has missed a period of 1 ms"""
INSTALL = "apt install rt-tests"
TOO_OLD = "it has no --json; install a newer rt-tests (Debian 12 has 2.4)"


def installed() -> bool:
    """Whether cyclictest is on this machine."""
    return shutil.which("cyclictest") is not None


def run_cyclictest(place: Placement, duration: float, period: float) -> dict[str, float]:
    """Run it for `duration` s with this period (s) on the rig's core, at the rig's priority; return `quantities`.

    Without SCHED_FIFO it is also told to leave the machine's idle states alone. Raises RigError if it fails.
    """
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        out = Path(folder) / "cyclictest.json"
        _run(place, duration, period, out)
        return quantities(json.loads(out.read_text(encoding="utf-8"))["thread"]["0"])


def _run(place: Placement, duration: float, period: float, out: Path) -> None:
    command = [
        "cyclictest", "--quiet", "--threads=1", f"--affinity={place.core}", f"--interval={round(period * 1e6)}",
        f"--duration={max(round(duration), 1)}", f"--histogram={LONGEST}", f"--json={out}", f"--policy={place.policy}",
        f"--priority={place.priority}", *(["--mlockall"] if place.policy == "fifo" else ["--default-system"]),
    ]  # fmt: skip
    patience = duration + 60.0
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=patience)
    except subprocess.TimeoutExpired:
        raise RigError(f"cyclictest did not end within {patience:.0f} s") from None
    if done.returncode != 0:
        first = ((done.stderr or done.stdout).strip().splitlines() or ["it printed nothing"])[0]
        why = TOO_OLD if "--json" in first else first
        raise RigError(f"cyclictest ended with exit code {done.returncode}: {why}")


def quantities(thread: Mapping[str, Any]) -> dict[str, float]:
    """Return wakeups, over_1ms, over_1ms_fraction and lateness_{p50,p99,max}_us of a thread in cyclictest's JSON.

    `histogram` there counts the cycles by lateness in whole microseconds, rounded down; `cycles` is their number
    including those beyond the histogram, whose lateness is taken as the largest, `max`. A quantile is the lowest
    lateness that this fraction of cycles does not exceed. Raises RigError if there was no cycle.
    """
    counts = {int(lateness): int(count) for lateness, count in thread["histogram"].items()}
    total, largest = int(thread["cycles"]), int(thread["max"])
    if not total:
        raise RigError("cyclictest counted no wake-up")
    counts[largest] = counts.get(largest, 0) + total - sum(counts.values())
    lateness, weights = np.array(list(counts)), np.array(list(counts.values()))
    p50, p99 = np.quantile(lateness, [0.50, 0.99], weights=weights, method="inverted_cdf")
    over = int(weights[lateness >= LATE].sum())
    return {
        "wakeups": float(total), "over_1ms": float(over), "over_1ms_fraction": over / total,
        "lateness_p50_us": float(p50), "lateness_p99_us": float(p99), "lateness_max_us": float(largest),
    }  # fmt: skip
