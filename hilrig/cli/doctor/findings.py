"""What a machine's set-up means for a loop at 1 ms, and the command that fixes each fault. No I/O.

Commands are for Debian and Ubuntu.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

from hilrig.cli.doctor.host import Host
from hilrig.cli.doctor.verdict import Probe

LIMITS = "/etc/security/limits.d/99-hilrig.conf"
SHALLOW = 20e-6
"""s; an idle state with a shorter exit latency is hidden by the scheduler's own lateness"""
BUSY = 0.3
"""Mean number of running processes above which the machine was not idle during the probe"""
FEW = 4
"""With fewer cores, none can be reserved for the loop"""
STOLEN = 0.002
"""Fraction of the cores' time: 2 ms of each second"""
SLOW_CLOCKS = ("hpet", "acpi_pm", "jiffies", "refined-jiffies")
"""Clock sources that need a system call, which takes a microsecond or more"""


class Finding(NamedTuple):
    """One property of the machine."""

    name: str
    value: str
    verdict: Literal["ok", "note", "fault"]
    """"note": useful to know, but it cannot or need not be fixed"""
    remedy: str = ""
    """A command that fixes the fault, or what to do in words; empty if there is nothing to do"""


def findings(host: Host) -> list[Finding]:
    """Return the findings about the machine, the most important first."""
    return [*_kernel(host), *_permissions(host), *_power(host), *_cores(host), *_machine(host), *_software(host)]


def from_probe(probe: Probe) -> list[Finding]:
    """Return the findings that only a probe can make."""
    if probe.steal > STOLEN:
        remedy = "give the virtual machine its own cores on the host, or run on the host itself"
        return [Finding("stolen time", f"{probe.steal:.1%} went to other virtual machines", "fault", remedy)]
    return [Finding("stolen time", f"{probe.steal:.1%}", "ok")]


def _kernel(host: Host) -> Iterator[Finding]:
    if host.preemption == "rt":
        yield Finding("kernel", f"{host.release}, PREEMPT_RT", "ok")
    else:
        realtime = {
            "debian": "sudo apt install linux-image-rt-$(dpkg --print-architecture)  # then reboot",
            "ubuntu": "sudo pro enable realtime-kernel  # then reboot",
        }.get(host.system, "")
        yield Finding("kernel", f"{host.release}, without PREEMPT_RT", "note", realtime)
        yield _preemption(host)


def _preemption(host: Host) -> Finding:
    now = host.preemption or "unknown"
    if now == "full":
        return Finding("preemption", now, "ok")
    if now == "unknown":
        return Finding("preemption", "unknown: the kernel does not say", "note")
    if host.preemption_selectable:
        lasting = "permanently: preempt=full on the kernel command line"
        command = f"echo full | sudo tee /sys/kernel/debug/sched/preempt  # {lasting}"
        return Finding("preemption", now, "fault", command)
    return Finding("preemption", f"{now}, fixed when the kernel was built", "note")


def _permissions(host: Host) -> Iterator[Finding]:
    if host.tried.fifo:
        command = f'echo "$USER - rtprio 98" | sudo tee -a {LIMITS}  # then log in again'
        in_container = "docker run --cap-add=SYS_NICE --ulimit rtprio=98 ..."
        remedy = in_container if host.tried.container else command
        yield Finding("SCHED_FIFO", f"refused: {host.tried.fifo}", "fault", remedy)
    else:
        yield Finding("SCHED_FIFO", "permitted", "ok")
    yield _throttling(host)
    yield _memory(host)
    if host.swaps and not _memory_is_locked(host):
        yield Finding("swap", f"in use ({', '.join(host.swaps)}), and memory is not locked", "fault", "sudo swapoff -a")
    else:
        yield Finding("swap", f"in use ({', '.join(host.swaps)}); memory is locked" if host.swaps else "none", "ok")


def _throttling(host: Host) -> Finding:
    command = "sudo sysctl kernel.sched_rt_runtime_us=950000"
    if host.rt_runtime is None:
        value = "no limit: a law that hangs under SCHED_FIFO blocks its core"
        return Finding("SCHED_FIFO share", value, "note", command)
    share = f"{host.rt_runtime:.0%} of a core"
    if host.rt_runtime < 0.9:
        return Finding("SCHED_FIFO share", f"{share}: the loop is throttled when it takes more", "fault", command)
    return Finding("SCHED_FIFO share", share, "ok")


def _memory_is_locked(host: Host) -> bool:
    return host.may_lock_memory or host.memory_lock_limit is None


def _memory(host: Host) -> Finding:
    if host.memory_lock_limit is None:
        return Finding("locked memory", "no limit", "ok")
    limit = f"limit {host.memory_lock_limit >> 10} KiB"
    if host.may_lock_memory:
        return Finding("locked memory", f"{limit}, which does not apply to this user (CAP_IPC_LOCK)", "ok")
    command = f'echo "$USER - memlock unlimited" | sudo tee -a {LIMITS}  # then log in again'
    in_container = "docker run --ulimit memlock=-1 ..."
    return Finding("locked memory", limit, "fault", in_container if host.tried.container else command)


def _power(host: Host) -> Iterator[Finding]:
    governors = ", ".join(host.governors)
    if not host.governors:
        yield Finding("governor", "none: this system does not control the frequency", "ok")
    elif host.governors == ("performance",):
        yield Finding("governor", governors, "ok")
    else:
        package = "linux-tools-generic" if host.system == "ubuntu" else "linux-cpupower"
        command = f"sudo cpupower frequency-set -g performance  # package {package}"
        yield Finding("governor", governors, "fault", command)
    yield _idle(host)


def _idle(host: Host) -> Finding:
    if not host.idle_states:
        return Finding("idle states", "this system does not control them", "ok")
    deepest = host.idle_states[-1]
    value = f"{deepest.name}, exit latency {deepest.latency * 1e6:.0f} us"
    if host.dma_latency == "writable":
        return Finding("idle states", f"{value}; a trial allows at most 2 us", "ok")
    if deepest.latency <= SHALLOW:
        return Finding("idle states", value, "ok")
    value = f"{value}; /dev/cpu_dma_latency is {host.dma_latency}"
    if host.dma_latency == "absent":
        command = f"sudo cpupower idle-set -D {SHALLOW * 1e6:.0f}  # until reboot"
    else:
        command = 'sudo chown "$USER" /dev/cpu_dma_latency  # until reboot'
    return Finding("idle states", value, "fault", command)


def _cores(host: Host) -> Iterator[Finding]:
    value = f"{host.cores}" if host.usable_cores == host.cores else f"{host.cores}, of which {host.usable_cores} usable"
    if host.usable_cores < 2:
        yield Finding(
            "cores", f"{value}: the logger and everything else share the loop's core", "fault", "add a second core"
        )
    else:
        yield Finding("cores", value, "ok")
    if host.threads_per_core > 1:
        value = f"{host.threads_per_core} per core: a process on the other thread slows the loop"
        yield Finding("threads", value, "note", "echo off | sudo tee /sys/devices/system/cpu/smt/control")
    yield _isolation(host)


def _isolation(host: Host) -> Finding:
    if host.isolated:
        ticks = "no timer tick" if set(host.isolated) <= set(host.tickless) else "with timer tick"
        return Finding("isolated cores", f"{', '.join(map(str, host.isolated))}, {ticks}", "ok")
    if host.cores < FEW:
        return Finding("isolated cores", f"none; {host.cores} cores are too few to reserve one", "note")
    last = host.cores - 1
    parameters = f"isolcpus={last} nohz_full={last} rcu_nocbs={last}"
    remedy = f"add '{parameters}' to GRUB_CMDLINE_LINUX in /etc/default/grub; sudo update-grub; reboot"
    return Finding("isolated cores", "none: other processes may run on the loop's core", "note", remedy)


def _machine(host: Host) -> Iterator[Finding]:
    source = host.clock_source or "unknown"
    if source in SLOW_CLOCKS:
        better = next((name for name in ("tsc", *host.clock_sources) if name in host.clock_sources), "")
        usable = better not in ("", *SLOW_CLOCKS)
        path = "/sys/devices/system/clocksource/clocksource0/current_clocksource"
        remedy = f"echo {better} | sudo tee {path}" if usable else "boot with the kernel parameter tsc=reliable"
        yield Finding("clock source", f"{source}: slow to read", "fault", remedy)
    else:
        yield Finding("clock source", source, "ok")
    if host.hypervisor or host.tried.virtual_machine:
        kind = host.tried.virtual_machine or "of an unknown kind"
        yield Finding("virtual machine", f"yes, {kind}: its host may pause it at any time", "note")
    else:
        yield Finding("virtual machine", "no", "ok")
    if host.tried.container:
        yield Finding(
            "container", f"{host.tried.container}: kernel and devices belong to its host; change them there", "note"
        )
    if host.load > BUSY:
        yield Finding("load", f"{host.load:.2f}: other processes were running in the last minute", "note")
    else:
        yield Finding("load", f"{host.load:.2f}", "ok")


def _software(host: Host) -> Iterator[Finding]:
    yield Finding("bus", f"zenoh {host.tried.zenoh}, unix sockets, low-latency link", "ok")
    yield Finding("ROS", ", ".join(host.tried.ros) or "not found; hilrig does not need it", "ok")
