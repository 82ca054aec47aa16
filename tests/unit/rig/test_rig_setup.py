"""Each setting, applied in a process of its own, against what the kernel says about that process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from helpers.patience import PATIENCE

from hilrig.experiment.rig_settings import RigSettings
from hilrig.rig import cores, scheduling
from hilrig.rig.setup import refusals

APPLY = """
import ctypes, gc, json, os, resource, sys
from pathlib import Path
from hilrig.rig import memory, setup
from hilrig.experiment.rig_settings import RigSettings

settings, role, realtime, limit = json.loads(sys.argv[1])
if limit is not None:  # become an ordinary user with this limit of locked memory
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (limit, limit))
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    if os.geteuid() == 0:
        os.setgroups([])
        os.setresgid(65534, 65534, 65534)
        os.setresuid(65534, 65534, 65534)
binds = memory.limit_binds()
core = min(os.sched_getaffinity(0))
report = setup.prepare(RigSettings(**settings), role, [core], realtime)
report |= setup.settle(RigSettings(**settings), role, realtime)
status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
held = [os.stat(file) for file in setup._held]
device = os.stat(setup.DMA_LATENCY).st_rdev if os.path.exists(setup.DMA_LATENCY) else None
print(json.dumps({
    "report": report, "core": str(core), "cores": status["Cpus_allowed_list"].strip(),
    "locked": int(status["VmLck"].split()[0]), "size": int(status["VmSize"].split()[0]),
    "slack": ctypes.CDLL(None).prctl(30, 0, 0, 0, 0), "policy": os.sched_getscheduler(0),
    "priority": os.sched_getparam(0).sched_priority, "frozen": gc.get_freeze_count() > 0 and not gc.isenabled(),
    "holds": [item.st_rdev == device for item in held], "binds": binds,
}))
"""


def applied(
    role: str = "driver", *, realtime: bool = True, limit: int | None = None, **changes: Any
) -> tuple[dict[str, dict[str, str]], dict[str, Any]]:
    """Return (the report, what the kernel says) of a process with these settings.

    With `limit`, bytes, it is that of a user without privileges who may lock so much memory.
    """
    orders = json.dumps([asdict(RigSettings(**changes)), role, realtime, limit])
    done = subprocess.run([sys.executable, "-c", APPLY, orders], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    return found.pop("report"), found


def test_what_the_driver_reports_is_what_the_kernel_says() -> None:
    report, kernel = applied()
    assert report["pin"]["applied"] == kernel["cores"] == kernel["core"]
    assert kernel["frozen"]
    if not report["scheduler"]["reason"]:
        assert report["scheduler"]["applied"] == "fifo 51"
        assert (kernel["policy"], kernel["priority"]) == (os.SCHED_FIFO, 51)
    if not report["lock_memory"]["reason"]:
        assert kernel["locked"] > 0.9 * kernel["size"] > 0
    if not report["cpu_dma_latency"]["reason"]:
        assert kernel["holds"] == [True]


def test_as_root_nothing_is_refused() -> None:
    if os.geteuid() != 0:
        pytest.skip("needs root")
    report, kernel = applied(priority=7)
    refused = set() if os.path.exists("/dev/cpu_dma_latency") else {"cpu_dma_latency"}
    assert {name for name, item in report.items() if item["reason"]} == refused
    assert (kernel["priority"], kernel["binds"]) == (8, False)
    assert refusals({**report, "cpu_dma_latency": report["pin"]}) == []


def test_without_privileges_refusals_are_reported_and_the_rest_is_applied() -> None:
    report, kernel = applied(limit=1 << 20)
    assert report["scheduler"]["applied"] == "other"
    assert report["scheduler"]["reason"].endswith("the limit of real-time priority (ulimit -r) is 0")
    assert kernel["policy"] == os.SCHED_OTHER
    assert report["lock_memory"]["reason"] == "the limit of locked memory (ulimit -l) is 1024 KiB"
    assert (kernel["locked"], kernel["binds"]) == (0, True)
    assert report["cpu_dma_latency"]["reason"].startswith("/dev/cpu_dma_latency: ")
    assert report["timer_slack"] == {"wanted": "1 ns", "applied": "1 ns", "reason": ""}
    assert kernel["slack"] == 1
    assert report["pin"]["reason"] == ""
    assert kernel["cores"] == kernel["core"]
    assert kernel["frozen"]
    names = {line.split(":")[0] for line in refusals(report)}
    assert names == {"scheduler", "lock_memory", "cpu_dma_latency"}


def test_what_is_switched_off_is_left_as_it_is() -> None:
    off = {"lock_memory": False, "freeze_garbage": False, "pin": False, "cpu_dma_latency": None, "scheduler": "other"}
    report, kernel = applied(**off, timer_slack=30e-6)
    assert kernel["locked"] == 0
    assert not kernel["frozen"]
    assert kernel["holds"] == []
    assert kernel["policy"] == os.SCHED_OTHER
    assert kernel["slack"] == 30_000
    assert set(cores.listed(kernel["cores"])) == os.sched_getaffinity(0)
    assert refusals(report) == []


def test_the_controller_does_not_hold_dma_latency_and_the_logger_is_only_pinned() -> None:
    report, kernel = applied("controller")
    assert "cpu_dma_latency" not in report
    assert kernel["holds"] == []
    report, kernel = applied("logger")
    assert set(report) == {"pin", "freeze_garbage"}
    assert (kernel["policy"], kernel["locked"], kernel["slack"]) == (os.SCHED_OTHER, 0, 50_000)


def test_in_lockstep_the_settings_are_ignored() -> None:
    report, kernel = applied(realtime=False, pin=False, freeze_garbage=False, scheduler="fifo")
    assert kernel["policy"] == os.SCHED_BATCH
    assert kernel["cores"] == kernel["core"]
    assert kernel["frozen"]
    assert kernel["locked"] == 0
    assert set(report) == {"pin", "scheduler", "freeze_garbage"}


def test_the_highest_permitted_priority_is_taken_where_the_wanted_one_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    taken: list[int] = []

    def permit(process: int, policy: int, parameters: os.sched_param) -> None:
        if parameters.sched_priority > 20:
            raise PermissionError(1, "Operation not permitted")
        taken.append(parameters.sched_priority)

    monkeypatch.setattr(os, "sched_setscheduler", permit)
    monkeypatch.setattr(scheduling.resource, "getrlimit", lambda limit: (20, 20))
    monkeypatch.setattr(scheduling, "scheduler_now", lambda: f"fifo {taken[-1]}")
    assert scheduling.schedule("fifo", 50) == ("fifo 20", "the limit of real-time priority (ulimit -r) is 20")
    assert taken == [20]


@pytest.mark.parametrize(
    ("text", "numbers"), [("", []), ("\n", []), ("3", [3]), ("0-1\n", [0, 1]), ("0,2-4,7", [0, 2, 3, 4, 7])]
)
def test_a_list_as_the_kernel_writes_it(text: str, numbers: list[int]) -> None:
    assert cores.listed(text) == numbers


def test_isolated_cores_are_used_for_the_loop_in_real_time_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1})
    monkeypatch.setattr(cores, "ISOLATED", tmp_path / "isolated")
    both = {"driver": (0,), "controller": (0,), "logger": (1,)}
    assert cores.cores_for(0) == cores.cores_for(0, realtime=True) == both
    (tmp_path / "isolated").write_text("2-3\n")
    assert cores.cores_for(0) == both
    assert cores.cores_for(0, realtime=True) == {"driver": (2,), "controller": (2,), "logger": (0,)}
    assert cores.cores_for(1, realtime=True) == {"driver": (3,), "controller": (3,), "logger": (1,)}


def test_a_missing_core_is_reported() -> None:
    before = os.sched_getaffinity(0)
    now, reason = cores.pin([4000])
    assert set(map(int, now.split())) == before == os.sched_getaffinity(0)
    assert reason == "Invalid argument: this process may not run there"
