"""Measures what this machine does at 1 kHz: two processes of the loop's own make, with nothing to compute."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from hilrig.cli.doctor.verdict import Probe, Stamps, summarise
from hilrig.core.errors import RigError
from hilrig.experiment.rig_settings import RigSettings
from hilrig.rig.cores import cores_for
from hilrig.rig.launching import CHILD_ENVIRONMENT
from hilrig.rig.socket_folder import make_socket_folder

PERIOD = 1_000_000
"""ns"""
START_UP = 60.0
"""s that the processes are given to start and to end, beside the time of the probe"""


def probe(seconds: float, settings: RigSettings) -> Probe:
    """Return what a probe of `seconds` found. Raises RigError if one of its processes fails."""
    sockets = make_socket_folder()
    cores = cores_for(0, realtime=True)
    ticks = round(seconds * 1e9 / PERIOD)
    common = {
        "sockets": sockets, "ticks": ticks, "period": PERIOD, "settings": asdict(settings), "parent": os.getpid(),
        "out": str(Path(sockets) / "stamps.npy"),
    }  # fmt: skip
    children: dict[str, subprocess.Popen[str]] = {}
    try:
        before = _processor_time()
        for role in ("driver", "controller"):
            children[role] = _start({**common, "role": role, "cores": cores[role]})
        setup = {role: _account(role, child, seconds + START_UP) for role, child in children.items()}
        after = _processor_time()
        due, woke, published, received = np.load(common["out"])
    finally:
        for child in children.values():
            child.kill()
            child.communicate()
        shutil.rmtree(sockets, ignore_errors=True)
    total, stolen = after[0] - before[0], after[1] - before[1]
    return summarise(Stamps(PERIOD, due, woke, published, received), stolen / max(total, 1), setup)


def _start(orders: dict[str, Any]) -> subprocess.Popen[str]:
    command = [sys.executable, "-P", "-m", "hilrig.cli.doctor.probe_process", json.dumps(orders)]
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, env={**os.environ, **CHILD_ENVIRONMENT},
    )  # fmt: skip


def _account(role: str, child: subprocess.Popen[str], patience: float) -> dict[str, dict[str, str]]:
    """Wait for a process of the probe; return what it says of its set-up."""
    try:
        said, errors = child.communicate(timeout=patience)
    except subprocess.TimeoutExpired:
        raise RigError(f"the probe's {role} process did not end within {patience:.0f} s") from None
    if child.returncode != 0:
        last = (errors.strip().splitlines() or ["no word"])[-1]
        raise RigError(f"the probe's {role} process ended with exit code {child.returncode}: {last}")
    return json.loads(said)


def _processor_time() -> tuple[int, int]:
    """Return (time of all cores, time that the hypervisor took of it) so far, in the kernel's ticks."""
    fields = [int(word) for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
    return sum(fields[:8]), fields[7]
