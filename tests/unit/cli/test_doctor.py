"""What doctor reads about a machine, what it finds, and how it judges, each with a machine made for the test."""

from __future__ import annotations

import gzip
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.cli.doctor.findings import Finding, findings, from_probe
from hilrig.cli.doctor.host import Host, IdleState, Tried, read_host
from hilrig.cli.doctor.probe import wait_for
from hilrig.cli.doctor.verdict import Probe, ProbeStamps, judge_probe, summarise_probe
from hilrig.core.errors import RigError
from hilrig.rig.processes import ChildProcess, kill_all

TRIED = Tried(fifo="", virtual_machine="", container="", zenoh="1.10.2", ros=())
SETUP = {"driver": {"scheduler": {"wanted": "fifo 50", "applied": "fifo 50", "reason": ""}}}
LIMITS = """\
Limit                     Soft Limit           Hard Limit           Units
Max locked memory         8388608              unlimited            bytes
Max realtime priority     20                   99
"""
FILES = {
    "etc/os-release": 'PRETTY_NAME="Debian GNU/Linux 12 (bookworm)"\nID=debian\nVERSION_ID="12"\n',
    "proc/sys/kernel/osrelease": "6.1.0-18-amd64\n",
    "proc/sys/kernel/version": "#1 SMP PREEMPT_DYNAMIC Debian 6.1.76-1 (2024-02-01)\n",
    "proc/sys/kernel/sched_rt_runtime_us": "950000\n",
    "proc/sys/kernel/sched_rt_period_us": "1000000\n",
    "proc/cmdline": "root=/dev/sda1 quiet\n",
    "proc/self/limits": LIMITS,
    "proc/self/status": "Name:\tpython\nCapEff:\t0000000000004000\nCpus_allowed_list:\t0,2-3\n",
    "proc/cpuinfo": "flags\t\t: fpu hypervisor lahf_lm\n",
    "proc/swaps": "Filename\tType\tSize\tUsed\tPriority\n/dev/sda2 partition 999 0 -2\n",
    "proc/loadavg": "0.25 0.10 0.05 1/100 4242\n",
    "sys/devices/system/cpu/online": "0-3\n",
    "sys/devices/system/cpu/isolated": "2-3\n",
    "sys/devices/system/cpu/nohz_full": "(null)\n",
    "sys/devices/system/cpu/cpu0/topology/thread_siblings_list": "0,2\n",
    "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "schedutil\n",
    "sys/devices/system/cpu/cpu1/cpufreq/scaling_governor": "schedutil\n",
    "sys/devices/system/cpu/cpu0/cpuidle/state0/name": "POLL\n",
    "sys/devices/system/cpu/cpu0/cpuidle/state0/latency": "0\n",
    "sys/devices/system/cpu/cpu0/cpuidle/state1/name": "C6\n",
    "sys/devices/system/cpu/cpu0/cpuidle/state1/latency": "133\n",
    "sys/devices/system/clocksource/clocksource0/current_clocksource": "hpet\n",
    "sys/devices/system/clocksource/clocksource0/available_clocksource": "tsc hpet acpi_pm\n",
    "sys/kernel/debug/sched/preempt": "none (voluntary) full\n",
    "dev/cpu_dma_latency": "",
}


def machine(root: Path, **changes: str | None) -> Host:
    """Return what is read of a machine with the files above, and with `changes`, by path; None: it is not there."""
    for path, text in {**FILES, **changes}.items():
        if text is not None:
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text)
    return read_host(TRIED, root)


def test_every_file_is_read(tmp_path: Path) -> None:
    assert machine(tmp_path) == Host(
        system="debian", release="6.1.0-18-amd64", preemption="voluntary", preemption_selectable=True,
        rt_priority_limit=20, rt_runtime=0.95, memory_lock_limit=8388608, may_lock_memory=True,
        governors=("schedutil",), idle_states=(IdleState("POLL", 0.0), IdleState("C6", 133e-6)),
        dma_latency="writable", cores=4, usable_cores=3, isolated=(2, 3), tickless=(), threads_per_core=2,
        clock_source="hpet", clock_sources=("tsc", "hpet", "acpi_pm"), hypervisor=True, swaps=("/dev/sda2",),
        load=0.25, tried=TRIED,
    )  # fmt: skip


def test_a_machine_that_says_nothing_is_read_and_judged(tmp_path: Path) -> None:
    host = read_host(TRIED, tmp_path)
    assert (host.preemption, host.governors, host.idle_states, host.dma_latency) == ("", (), (), "absent")
    assert (host.cores, host.usable_cores, host.threads_per_core, host.swaps) == (1, 1, 1, ())
    assert findings(host)
    assert not (tmp_path / "dev").exists()


PREEMPTION = [
    ({"proc/sys/kernel/version": "#1 SMP PREEMPT_RT Debian"}, "rt"),
    ({"sys/kernel/realtime": "1\n"}, "rt"),
    ({}, "voluntary"),
    ({"sys/kernel/debug/sched/preempt": None, "proc/cmdline": "quiet preempt=full\n"}, "full"),
    ({"sys/kernel/debug/sched/preempt": None}, ""),
    ({"sys/kernel/debug/sched/preempt": None, "boot/config-6.1.0-18-amd64": "CONFIG_PREEMPT_LAZY=y\n"}, "lazy"),
    ({"sys/kernel/debug/sched/preempt": None, "boot/config-6.1.0-18-amd64": "CONFIG_PREEMPT=y\n"}, "full"),
]


@pytest.mark.parametrize(("changes", "model"), PREEMPTION)
def test_the_preemption_model_is_what_is_chosen_then_booted_then_built(
    tmp_path: Path, changes: dict[str, str | None], model: str
) -> None:
    assert machine(tmp_path, **changes).preemption == model


def test_the_configuration_that_the_kernel_carries_is_read(tmp_path: Path) -> None:
    (tmp_path / "proc").mkdir()
    text = b"CONFIG_PREEMPT_BUILD=y\nCONFIG_PREEMPT_NONE=y\n# CONFIG_PREEMPT is not set\n"
    (tmp_path / "proc/config.gz").write_bytes(gzip.compress(text))
    assert machine(tmp_path, **{"sys/kernel/debug/sched/preempt": None}).preemption == "none"


def test_no_limits_and_a_device_that_is_refused(tmp_path: Path) -> None:
    unlimited = LIMITS.replace("8388608", "unlimited").replace("20   ", "unlimited")
    host = machine(tmp_path, **{"proc/self/limits": unlimited, "proc/sys/kernel/sched_rt_runtime_us": "-1\n"})
    assert (host.memory_lock_limit, host.rt_priority_limit, host.rt_runtime) == (None, None, None)
    if os.geteuid() != 0:  # root may write to any file
        (tmp_path / "dev/cpu_dma_latency").chmod(0)
        assert read_host(TRIED, tmp_path).dma_latency == "refused"


GOOD = Host(
    system="debian", release="6.1.0-18-rt-amd64", preemption="rt", preemption_selectable=False, rt_priority_limit=99,
    rt_runtime=0.95, memory_lock_limit=None, may_lock_memory=False, governors=("performance",),
    idle_states=(IdleState("POLL", 0.0), IdleState("C6", 133e-6)), dma_latency="writable", cores=8, usable_cores=7,
    isolated=(7,), tickless=(7,), threads_per_core=1, clock_source="tsc", clock_sources=("tsc",), hypervisor=False,
    swaps=(), load=0.1, tried=TRIED,
)  # fmt: skip


def test_a_good_machine_has_nothing_to_fix() -> None:
    found = findings(GOOD)
    assert [item for item in found if item.verdict != "ok" or item.remedy] == []
    assert len({item.name for item in found}) == len(found)


WRONG: list[tuple[dict[str, Any], str, str, str]] = [
    ({"preemption": "voluntary"}, "kernel", "note", "linux-image-rt"),
    ({"preemption": "full", "system": "ubuntu"}, "kernel", "note", "sudo pro enable realtime-kernel"),
    ({"preemption": "none", "preemption_selectable": True}, "preemption", "fault", "echo full | sudo tee"),
    ({"preemption": "none"}, "preemption", "note", ""),
    ({"preemption": ""}, "preemption", "note", ""),
    ({"tried": TRIED._replace(fifo="no")}, "SCHED_FIFO", "fault", '"$USER - rtprio 98" | sudo tee -a /etc/security/'),
    ({"tried": TRIED._replace(fifo="no", container="docker")}, "SCHED_FIFO", "fault", "--cap-add=SYS_NICE"),
    ({"rt_runtime": None}, "SCHED_FIFO share", "note", "sudo sysctl kernel.sched_rt_runtime_us=950000"),
    ({"rt_runtime": 0.5}, "SCHED_FIFO share", "fault", "sudo sysctl kernel.sched_rt_runtime_us=950000"),
    ({"memory_lock_limit": 8 << 20}, "locked memory", "fault", '"$USER - memlock unlimited" | sudo tee -a'),
    ({"memory_lock_limit": 8 << 20, "swaps": ("/dev/sda2",)}, "swap", "fault", "sudo swapoff -a"),
    ({"governors": ("powersave",)}, "governor", "fault", "cpupower frequency-set -g performance  # package linux-cpup"),
    ({"governors": ("performance", "schedutil")}, "governor", "fault", "cpupower frequency-set -g performance"),
    ({"dma_latency": "refused"}, "idle states", "fault", 'sudo chown "$USER" /dev/cpu_dma_latency'),
    ({"dma_latency": "absent"}, "idle states", "fault", "sudo cpupower idle-set -D 20"),
    ({"cores": 1, "usable_cores": 1, "isolated": ()}, "cores", "fault", "second core"),
    ({"threads_per_core": 2}, "threads", "note", "echo off | sudo tee /sys/devices/system/cpu/smt/control"),
    ({"isolated": ()}, "isolated cores", "note", "isolcpus=7 nohz_full=7 rcu_nocbs=7"),
    ({"isolated": (), "cores": 2}, "isolated cores", "note", ""),
    ({"clock_source": "hpet", "clock_sources": ("tsc", "hpet")}, "clock source", "fault", "echo tsc | sudo tee /sys/"),
    ({"clock_source": "hpet", "clock_sources": ("hpet", "acpi_pm")}, "clock source", "fault", "tsc=reliable"),
    ({"hypervisor": True}, "virtual machine", "note", ""),
    ({"tried": TRIED._replace(container="docker")}, "container", "note", ""),
    ({"load": 1.0}, "load", "note", ""),
]


@pytest.mark.parametrize(("changes", "name", "verdict", "remedy"), WRONG)
def test_each_fault_is_found_with_its_remedy(changes: dict[str, Any], name: str, verdict: str, remedy: str) -> None:
    (item,) = [item for item in findings(replace(GOOD, **changes)) if item.name == name]
    assert item.verdict == verdict
    assert remedy in item.remedy
    assert bool(remedy) == bool(item.remedy)
    assert "\n" not in item.remedy


@pytest.mark.parametrize(
    "changes",
    [
        {"memory_lock_limit": 8 << 20, "may_lock_memory": True, "swaps": ("/dev/sda2",)},
        {"dma_latency": "refused", "idle_states": (IdleState("C1", 2e-6),)},
        {"governors": (), "idle_states": ()},
        {"clock_source": "kvm-clock"},
    ],
)
def test_what_is_harmless_is_no_fault(changes: dict[str, Any]) -> None:
    assert {item.verdict for item in findings(replace(GOOD, **changes))} == {"ok"}


def probe(**changes: Any) -> Probe:
    """Return a probe that is just good enough for "ready"."""
    plain: dict[str, Any] = {
        "ticks": 10_000, "period": 1e-3, "late": 10, "lateness_us": {"p99": 100.0}, "round_trip_us": {"p99": 500.0},
        "unanswered": 0, "steal": 0.0, "setup": SETUP,
    }  # fmt: skip
    return Probe(**{**plain, **changes})


REFUSED = {**SETUP, "controller": {"scheduler": {"wanted": "fifo 50", "applied": "other", "reason": "no"}}}
JUDGED: list[tuple[dict[str, Any], str, str]] = [
    ({}, "ready", ""),
    ({"late": 11}, "usable with late ticks", "0.11% of the ticks were late, more than 0.1%"),
    ({"late": 50}, "usable with late ticks", "0.50% of the ticks were late, more than 0.1%"),
    ({"late": 51}, "not ready", "0.51% of the ticks were late, more than 0.5%"),
    ({"lateness_us": {"p99": 101.0}}, "usable with late ticks", "lateness was 101 us at p99, more than 100 us"),
    ({"lateness_us": {"p99": 251.0}}, "not ready", "lateness was 251 us at p99, more than 250 us"),
    ({"round_trip_us": {"p99": 501.0}}, "usable with late ticks", "round trip over the bus took 501 us at p99"),
    ({"round_trip_us": {"p99": 1001.0}}, "not ready", "round trip over the bus took 1001 us at p99"),
    ({"round_trip_us": {}}, "not ready", "no answer came over the bus"),
    ({"setup": REFUSED}, "usable with late ticks", "SCHED_FIFO was refused"),
]


@pytest.mark.parametrize(("changes", "word", "reason"), JUDGED)
def test_the_verdict_follows_its_rule(changes: dict[str, Any], word: str, reason: str) -> None:
    verdict = judge_probe(probe(**changes))
    assert verdict.word == word
    assert reason in "\n".join(verdict.because)
    assert bool(verdict.because) == (word != "ready")


def test_stolen_time_is_a_fault() -> None:
    assert [item.verdict for item in from_probe(probe(steal=0.001))] == ["ok"]
    assert from_probe(probe(steal=0.05))[0][1:3] == ("5.0% went to other virtual machines", "fault")


def stamps(lateness: list[int], trips: list[int | None]) -> ProbeStamps:
    """Return the stamps of ticks 1 ms apart that woke so late, and whose answers took so long, all in us."""
    due = (1 + np.arange(len(lateness))) * 1_000_000
    woke = due + np.array(lateness) * 1000
    received = [0 if trip is None else at + trip * 1000 for at, trip in zip(woke.tolist(), trips, strict=True)]
    return ProbeStamps(1_000_000, due, woke, woke, np.array(received))


def test_a_tick_is_late_if_its_answer_is_not_there_or_if_it_began_a_period_late() -> None:
    quiet = summarise_probe(stamps([5] * 6, [200] * 6), 0.0, {})
    assert (quiet.ticks, quiet.late, quiet.unanswered) == (6, 0, 0)
    assert quiet.lateness_us == {"p50": 5.0, "p99": 5.0, "p99.9": 5.0, "max": 5.0}
    assert quiet.round_trip_us == {"p50": 200.0, "p99": 200.0, "p99.9": 200.0, "max": 200.0}
    assert summarise_probe(stamps([5] * 6, [200, 1001, 999, 200, None, 200]), 0.0, {}).late == 2
    # Tick 2 began a period late, and so its answer was not there at tick 3.
    assert summarise_probe(stamps([5, 5, 1000, 5, 5, 5], [200] * 6), 0.0, {}).late == 2
    assert summarise_probe(stamps([5, 5, 5, 5, 5, 1000], [200] * 6), 0.0, {}).late == 1
    assert summarise_probe(stamps([5] * 3, [None] * 3), 0.0, {}).round_trip_us == {}


@given(st.lists(st.tuples(st.integers(0, 900), st.none() | st.integers(1, 3000)), min_size=2, max_size=50))
def test_late_ticks_are_those_that_a_loop_of_one_tick_of_delay_would_hold(ticks: list[tuple[int, int | None]]) -> None:
    """Against a loop that takes what has come in when it wakes."""
    lateness, trips = [late for late, _ in ticks], [trip for _, trip in ticks]
    arrival = [None if trip is None else 1000 * k + late + trip for k, (late, trip) in enumerate(ticks)]
    held = 0
    for k in range(1, len(ticks)):
        there = {i for i, at in enumerate(arrival) if at is not None and at <= 1000 * k + lateness[k]}
        held += (k - 1) not in there
    found = summarise_probe(stamps(lateness, trips), 0.0, {})
    assert (found.late, found.unanswered) == (held, trips.count(None))


def test_findings_begin_in_lower_case_and_have_no_full_stop() -> None:
    """They are shown in a table."""
    for changes, *_ in WRONG:
        for item in findings(replace(GOOD, **changes)):
            assert isinstance(item, Finding)
            assert item.value
            assert not item.value.endswith(".")


@pytest.mark.parametrize(
    ("driver", "controller", "message"),
    [
        (
            "import time; time.sleep(1000)",
            "raise SystemExit('no bus')",
            "controller process ended with exit code 1: no bus",
        ),
        ("pass", "import time; time.sleep(1000)", "controller process did not end within 1 s"),
        ("import os; os.kill(os.getpid(), 9)", "pass", "driver process was killed by SIGKILL"),
        ("pass", "pass", None),
    ],
)
def test_a_probe_names_the_process_that_failed(
    tmp_path: Path, driver: str, controller: str, message: str | None
) -> None:
    children, logs = {}, {}
    for role, code in (("driver", driver), ("controller", controller)):
        logs[role] = tmp_path / f"{role}.log"
        with logs[role].open("wb") as log:
            process = subprocess.Popen([sys.executable, "-S", "-c", code], stdout=log, stderr=log)
        children[role] = ChildProcess(f"the probe's {role} process", process)
    try:
        if message is None:
            wait_for(children, logs, 60.0)
            assert [child.exit_code for child in children.values()] == [0, 0]
        else:
            with pytest.raises(RigError, match=f"^the probe's {message}$"):
                wait_for(children, logs, 1.0 if "did not end" in message else 60.0)
    finally:
        kill_all(children.values())
