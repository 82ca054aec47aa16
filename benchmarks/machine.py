"""What the figures were measured on, and what else that machine was doing."""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.placement import fifo_permitted
from hilrig.recording.manifest import provenance

BUSY_LOAD = 0.3
"""Load average above which the machine was not idle at the start"""
STOLEN = 0.01
"""Share of processor time that other guests of the host may take before it is told"""


class Processor(NamedTuple):
    """Processor time of all cores since the machine started, in the kernel's ticks."""

    total: int
    steal: int


def describe_machine() -> dict[str, Any]:
    """Return processor, cores, virtual machine, kernel, versions, permission and load average (of one minute)."""
    known = provenance(Path.cwd() / "none")
    versions = known["versions"]
    return {
        "cpu": known["host"]["cpu"],
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": known["host"]["memory_gib"],
        "virtual_machine": _virtual_machine(),
        "kernel": platform.release(),
        "preemption": _preemption(),
        "python": known["python"],
        "zenoh": versions.get("eclipse-zenoh"),
        "numba": versions.get("numba"),
        "hilrig": metadata.version("hilrig"),
        "commit": provenance(Path(__file__))["commit"],
        "sched_fifo": fifo_permitted(),
        "load_average": round(os.getloadavg()[0], 2),
    }


def _virtual_machine() -> str:
    """Return the virtual machine's name, "none", or "unknown"."""
    try:
        done = subprocess.run(["systemd-detect-virt", "--vm"], capture_output=True, text=True, timeout=10)
        if done.stdout.strip():
            return done.stdout.strip()
    except (OSError, subprocess.TimeoutExpired):
        pass
    try:
        flags = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return "unknown"
    return "yes (kind unknown)" if " hypervisor" in flags else "unknown"


def _preemption() -> str:
    """Return the preemption model that the kernel's version tells of."""
    words = platform.version().split()
    return next((word for word in words if word.startswith("PREEMPT")), "not told")


def processor_time() -> Processor:
    """Return the processor time so far; zeros where the kernel does not tell."""
    try:
        line = Path("/proc/stat").read_text(encoding="utf-8").splitlines()[0]
    except OSError:
        return Processor(0, 0)
    return read_processor_time(line)


def read_processor_time(line: str) -> Processor:
    """Return what the first line of /proc/stat says: user nice system idle iowait irq softirq steal ..."""
    times = [int(word) for word in line.split()[1:9]]
    return Processor(sum(times), times[7])


def warnings(load_average: float, before: Processor, after: Processor) -> Sequence[str]:
    """Return what may have disturbed the figures, in words."""
    found = []
    if load_average > BUSY_LOAD:
        found.append(
            f"the machine was busy at the start: load average {load_average:.2f}, over {BUSY_LOAD:g}; "
            "end other programs, wait a minute, and measure again"
        )
    total = after.total - before.total
    stolen = (after.steal - before.steal) / total if total else 0.0
    if stolen > STOLEN:
        found.append(
            f"the host gave {stolen:.1%} of the processor time to others while this was measured, over {STOLEN:.0%}; "
            "the tails of all times are longer for it"
        )
    return found
