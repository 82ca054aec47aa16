"""The machine that the figures were measured on, and its other load."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import psutil

from hilrig.cli.doctor.findings import BUSY, STOLEN
from hilrig.cli.doctor.host import read_host
from hilrig.cli.doctor.trying import try_things
from hilrig.experiment.rig_settings import RigSettings
from hilrig.recording.manifest import provenance


class ProcessorTime(NamedTuple):
    """Processor time of all cores since the machine started, s."""

    total: float
    steal: float
    """Part of it that other guests of the host took"""


def describe_machine() -> dict[str, Any]:
    """Return processor, cores, virtual machine, kernel, versions, permission and load average (of one minute)."""
    host = read_host(try_things(RigSettings().priority))
    known = provenance(Path(__file__))
    versions = known["versions"]
    return {
        "cpu": known["host"]["cpu"],
        "cores": host.usable_cores,
        "memory_gib": known["host"]["memory_gib"],
        "virtual_machine": host.tried.virtual_machine or ("of unknown kind" if host.hypervisor else "none"),
        "kernel": host.release,
        "preemption": host.preemption or "unknown",
        "python": known["python"],
        "zenoh": versions.get("eclipse-zenoh"),
        "numba": versions.get("numba"),
        "hilrig": metadata.version("hilrig"),
        "commit": known["commit"],
        "sched_fifo": not host.tried.fifo,
        "load_average": round(os.getloadavg()[0], 2),
    }


def processor_time() -> ProcessorTime:
    """Return the processor time so far."""
    times = psutil.cpu_times()
    return ProcessorTime(sum(times[:8]), times.steal)  # the later fields are included in the first two


def warnings(load_average: float, before: ProcessorTime, after: ProcessorTime) -> Sequence[str]:
    """Return what may have disturbed the figures, one sentence each. The limits are those of `hilrig doctor`."""
    found = []
    if load_average > BUSY:
        found.append(
            f"the machine was busy at the start: load average {load_average:.2f}, over {BUSY:g}; "
            "end other programs, wait a minute, and measure again"
        )
    total = after.total - before.total
    stolen = (after.steal - before.steal) / total if total else 0.0
    if stolen > STOLEN:
        found.append(
            f"the host gave {stolen:.1%} of the processor time to other guests while this was measured, over "
            f"{STOLEN:.1%}; this makes the tails of all times longer"
        )
    return found
