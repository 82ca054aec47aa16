"""Reads the properties of a machine that matter to a real-time loop, without judging them."""

from __future__ import annotations

import gzip
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from hilrig.rig.cores import listed

CAP_IPC_LOCK = 14


class IdleState(NamedTuple):
    """An idle state of a core."""

    name: str
    latency: float
    """Exit latency, s"""


class Tried(NamedTuple):
    """Properties that are not in any file and were found by trying or asking."""

    fifo: str
    """Why SCHED_FIFO was refused; empty if it was not"""
    virtual_machine: str
    """Kind of virtual machine; empty if unknown, or none"""
    container: str
    zenoh: str
    """Version"""
    ros: tuple[str, ...]
    """The ROS installations found, in words"""


@dataclass(frozen=True)
class Host:
    """The properties of a machine that matter to a real-time loop; unknown ones are empty or None."""

    system: str
    """Distribution, such as "debian" or "ubuntu\""""
    release: str
    """Of the kernel"""
    preemption: str
    """Model of the kernel: "rt", "full", "lazy", "voluntary" or "none\""""
    preemption_selectable: bool
    """Whether the model can be changed while the kernel runs"""
    rt_priority_limit: int | None
    """RLIMIT_RTPRIO; None for unlimited"""
    rt_runtime: float | None
    """s of each second that SCHED_FIFO may use; None for all of it"""
    memory_lock_limit: int | None
    """RLIMIT_MEMLOCK in bytes; None for unlimited"""
    may_lock_memory: bool
    """Whether the process has the capability CAP_IPC_LOCK"""
    governors: tuple[str, ...]
    """Frequency governors in use; empty without cpufreq"""
    idle_states: tuple[IdleState, ...]
    """Idle states of the first core, the deepest last; empty without cpuidle"""
    dma_latency: str
    """/dev/cpu_dma_latency: "writable", "refused" or "absent\""""
    cores: int
    """Cores that are online"""
    usable_cores: int
    """Cores that this process may use"""
    isolated: tuple[int, ...]
    """Cores that the scheduler leaves alone (isolcpus)"""
    tickless: tuple[int, ...]
    """Cores without a timer tick (nohz_full)"""
    threads_per_core: int
    clock_source: str
    clock_sources: tuple[str, ...]
    """Those that may be chosen"""
    hypervisor: bool
    """Whether the processor reports a hypervisor"""
    swaps: tuple[str, ...]
    """Swap areas in use"""
    load: float
    """Running and runnable processes, mean over the last minute"""
    tried: Tried


def read_host(tried: Tried, root: Path = Path("/")) -> Host:
    """Return the machine's properties from the files below `root`."""
    files = _Files(root)
    version, command = files.text("proc/sys/kernel/version"), files.text("proc/cmdline")
    limits, cpu = files.text("proc/self/limits"), files.text("proc/cpuinfo")
    runtime = _whole(files.text("proc/sys/kernel/sched_rt_runtime_us"), 950_000)
    period = _whole(files.text("proc/sys/kernel/sched_rt_period_us"), 1_000_000)
    return Host(
        system=_field(files.text("etc/os-release"), r"^ID=\"?(\w+)"),
        release=files.text("proc/sys/kernel/osrelease"),
        preemption=_preemption(files, version, command),
        preemption_selectable="PREEMPT_DYNAMIC" in version,
        rt_priority_limit=_limit(limits, "Max realtime priority"),
        rt_runtime=None if runtime < 0 else runtime / period,
        memory_lock_limit=_limit(limits, "Max locked memory"),
        may_lock_memory=bool(_capabilities(files.text("proc/self/status")) >> CAP_IPC_LOCK & 1),
        governors=tuple(sorted(set(files.texts("sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor")))),
        idle_states=_idle_states(files),
        dma_latency=files.permission("dev/cpu_dma_latency"),
        cores=len(listed(files.text("sys/devices/system/cpu/online") or "0")),
        usable_cores=len(listed(_field(files.text("proc/self/status"), r"^Cpus_allowed_list:\s*(\S+)") or "0")),
        isolated=tuple(listed(files.text("sys/devices/system/cpu/isolated"))),
        tickless=_cores(files.text("sys/devices/system/cpu/nohz_full")),
        threads_per_core=len(_cores(files.text("sys/devices/system/cpu/cpu0/topology/thread_siblings_list"))) or 1,
        clock_source=files.text("sys/devices/system/clocksource/clocksource0/current_clocksource"),
        clock_sources=tuple(files.text("sys/devices/system/clocksource/clocksource0/available_clocksource").split()),
        hypervisor=bool(re.search(r"^flags\s*:.*\bhypervisor\b", cpu, re.MULTILINE)),
        swaps=tuple(line.split()[0] for line in files.text("proc/swaps").splitlines()[1:]),
        load=float((files.text("proc/loadavg") or "0").split()[0]),
        tried=tried,
    )


class _Files:
    """Files below a root; a missing or unreadable file counts as empty."""

    def __init__(self, root: Path) -> None:
        self._root = root

    def text(self, path: str) -> str:
        try:
            return (self._root / path).read_text(errors="replace").strip()
        except OSError:
            return ""

    def texts(self, pattern: str) -> list[str]:
        """Return the texts of all files that match, in the order of their paths."""
        return [self.text(str(path.relative_to(self._root))) for path in sorted(self._root.glob(pattern))]

    def packed(self, path: str) -> str:
        """Return the text of a gzip-compressed file."""
        try:
            return gzip.decompress((self._root / path).read_bytes()).decode(errors="replace")
        except OSError:
            return ""

    def permission(self, path: str) -> str:
        """Return "writable", "refused" or "absent"."""
        try:
            os.close(os.open(self._root / path, os.O_WRONLY))
            return "writable"
        except FileNotFoundError:
            return "absent"
        except OSError:
            return "refused"


def _field(text: str, pattern: str) -> str:
    found = re.search(pattern, text, re.MULTILINE)
    return found.group(1) if found else ""


def _whole(text: str, missing: int) -> int:
    return int(text) if text else missing


def _limit(limits: str, name: str) -> int | None:
    """Return the soft limit from /proc/self/limits; None for unlimited, 0 if missing."""
    value = _field(limits, rf"^{name}\s+(\S+)")
    return None if value == "unlimited" else int(value or 0)


def _capabilities(status: str) -> int:
    return int(_field(status, r"^CapEff:\s*([0-9a-f]+)") or "0", 16)


def _cores(text: str) -> tuple[int, ...]:
    """Return the cores in a list that may also be "(null)"."""
    return tuple(listed(text)) if text[:1].isdigit() else ()


def _idle_states(files: _Files) -> tuple[IdleState, ...]:
    folder = "sys/devices/system/cpu/cpu0/cpuidle/state[0-9]*"
    names, latencies = files.texts(f"{folder}/name"), files.texts(f"{folder}/latency")
    states = [IdleState(name, int(latency) * 1e-6) for name, latency in zip(names, latencies, strict=True)]
    return tuple(sorted(states, key=lambda state: state.latency))


def _preemption(files: _Files, version: str, command: str) -> str:
    """Return the kernel's preemption model: as reported now, else from the boot options, else from the build."""
    if files.text("sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        return "rt"
    now = _field(files.text("sys/kernel/debug/sched/preempt"), r"\((\w+)\)")
    booted = _field(command, r"(?:^|\s)preempt=(\w+)")
    return now or booted or _built(_configuration(files))


def _configuration(files: _Files) -> str:
    """Return the kernel's build configuration, or as much of it as there is."""
    packed = files.packed("proc/config.gz")
    return packed or files.text(f"boot/config-{files.text('proc/sys/kernel/osrelease')}")


def _built(configuration: str) -> str:
    models = {"PREEMPT_NONE": "none", "PREEMPT_VOLUNTARY": "voluntary", "PREEMPT_LAZY": "lazy", "PREEMPT": "full"}
    return next((model for name, model in models.items() if f"CONFIG_{name}=y" in configuration.splitlines()), "")
