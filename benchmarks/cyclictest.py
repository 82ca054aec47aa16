"""cyclictest of rt-tests: how late this machine wakes a thread that does nothing else."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping

import numpy as np

from benchmarks.placement import Placement
from hilrig.core.errors import RigError

LONGEST = 20_000
"""us of lateness that the histogram holds"""
LATE = 1000
"""us: a wake-up that is later than this has missed a period of 1 ms"""
INSTALL = "apt install rt-tests"


def installed() -> bool:
    """Whether cyclictest is on this machine."""
    return shutil.which("cyclictest") is not None


def run_cyclictest(place: Placement, duration: float, period: float) -> dict[str, float]:
    """Run it for `duration` s with this period (s) on the rig's core, at the rig's priority; return `quantities`.

    Without SCHED_FIFO it also leaves the machine's idle states alone. Raises RigError if it does not do it.
    """
    command = [
        "cyclictest", "--quiet", "--threads=1", f"--affinity={place.core}", f"--interval={round(period * 1e6)}",
        f"--duration={max(round(duration), 1)}", f"--histogram={LONGEST}", f"--policy={place.policy}",
        f"--priority={place.priority}", *(["--mlockall"] if place.policy == "fifo" else ["--default-system"]),
    ]  # fmt: skip
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=duration + 60.0)
    except subprocess.TimeoutExpired:
        raise RigError(f"cyclictest did not end within {duration + 60.0:.0f} s") from None
    if done.returncode != 0:
        lines = (done.stderr or done.stdout).strip().splitlines()
        raise RigError(f"cyclictest ended with exit code {done.returncode}: {lines[0] if lines else ''}")
    return quantities(read_histogram(done.stdout), read_summary(done.stdout))


def read_histogram(text: str) -> dict[int, int]:
    """Return lateness in whole us -> wake-ups, from what cyclictest --histogram printed for one thread."""
    rows = re.findall(r"^(\d+)\s+(\d+)\s*$", text, re.MULTILINE)
    return {int(lateness): int(count) for lateness, count in rows if int(count)}


def read_summary(text: str) -> dict[str, int]:
    """Return the largest lateness (us) and the wake-ups beyond the histogram. Raises RigError if they are not there."""
    found = {}
    for key, label in (("max", "Max Latencies"), ("overflows", "Histogram Overflows")):
        match = re.search(rf"^# {label}:\s*(\d+)", text, re.MULTILINE)
        if match is None:
            raise RigError(f"cyclictest printed no '{label}'")
        found[key] = int(match[1])
    return found


def quantities(histogram: Mapping[int, int], summary: Mapping[str, int]) -> dict[str, float]:
    """Return wakeups, over_1ms, over_1ms_fraction and lateness_{p50,p99,max}_us.

    A quantile is the lowest lateness that so many wake-ups do not exceed; cyclictest counts whole microseconds, rounded
    down. Wake-ups beyond the histogram count as the latest one.
    """
    bins = {**histogram}
    if summary["overflows"]:
        bins[summary["max"]] = bins.get(summary["max"], 0) + summary["overflows"]
    if not bins:
        raise RigError("cyclictest counted no wake-up")
    lateness = np.array(sorted(bins))
    reached = np.cumsum([bins[value] for value in lateness.tolist()])
    total = int(reached[-1])
    over = sum(count for value, count in bins.items() if value >= LATE)
    found = {"wakeups": float(total), "over_1ms": float(over), "over_1ms_fraction": over / total}
    for name, fraction in (("p50", 0.50), ("p99", 0.99)):
        found[f"lateness_{name}_us"] = float(lateness[np.searchsorted(reached, fraction * total)])
    return {**found, "lateness_max_us": float(summary["max"])}
