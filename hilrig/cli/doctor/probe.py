"""Measures this machine's timing at 1 kHz: two processes, set up like those of a trial, that compute nothing."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from hilrig.cli.doctor.verdict import Probe, ProbeStamps, summarise_probe
from hilrig.core.errors import RigError
from hilrig.experiment.rig_settings import RigSettings
from hilrig.rig.cores import cores_for
from hilrig.rig.processes import ChildProcess, kill_all, pause
from hilrig.rig.socket_folder import make_socket_folder

PERIOD_NS = 1_000_000
START_UP_TIMEOUT_S = 60.0
"""How long the processes may take to start and to end, in addition to the probe itself"""


def probe(seconds: float, settings: RigSettings) -> Probe:
    """Return the result of a probe of `seconds`. Raises RigError if one of its processes fails."""
    sockets = make_socket_folder()
    cores = cores_for(0, realtime=True)
    ticks = round(seconds * 1e9 / PERIOD_NS)
    common = {
        "sockets": sockets, "ticks": ticks, "period_ns": PERIOD_NS, "settings": asdict(settings), "parent": os.getpid(),
    }  # fmt: skip
    logs = {role: Path(sockets) / f"{role}.log" for role in ("driver", "controller")}
    children: dict[str, ChildProcess] = {}
    try:
        before = _processor_time()
        for role, log in logs.items():
            orders = json.dumps({**common, "role": role, "cores": cores[role]})
            name, module = f"the probe's {role} process", "hilrig.cli.doctor.probe_process"
            children[role] = ChildProcess.start(name, module, orders, log)
        wait_for(children, logs, seconds + START_UP_TIMEOUT_S)
        after = _processor_time()
        setup = {role: json.loads((Path(sockets) / f"{role}.json").read_text()) for role in children}
        due, woke, published, received = np.load(Path(sockets) / "stamps.npy")
    finally:
        kill_all(children.values())
        shutil.rmtree(sockets, ignore_errors=True)
    total, stolen = after[0] - before[0], after[1] - before[1]
    return summarise_probe(ProbeStamps(PERIOD_NS, due, woke, published, received), stolen / max(total, 1), setup)


def wait_for(children: Mapping[str, ChildProcess], logs: Mapping[str, Path], timeout_s: float) -> None:
    """Wait until all have ended without error.

    Raises RigError for the first that failed, or is still running at the end.
    """

    def one_failed() -> bool:
        return pause() or any(child.failed for child in children.values())

    in_time = all(child.wait(timeout_s, one_failed) for child in children.values())
    for role, child in children.items():
        if child.failed:
            raise RigError(child.how_it_ended(logs[role]))
    if not in_time:
        late = next(child for child in children.values() if child.exit_code is None)
        raise RigError(f"{late.name} did not end within {timeout_s:.0f} s")


def _processor_time() -> tuple[int, int]:
    """Return (time of all cores, part of it taken by the hypervisor) so far, in the kernel's ticks."""
    fields = [int(word) for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
    return sum(fields[:8]), fields[7]
