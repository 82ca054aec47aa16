"""Round trips of a bare pair of processes over one transport: runs the scripts in peers/ and reads what they print."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.placement import Placement
from hilrig.core.errors import RigError
from hilrig.experiment.rig_settings import RigSettings
from hilrig.rig.processes import CHILD_ENVIRONMENT

SCRIPT = Path(__file__).parent / "peers" / "pair.py"
SYSTEM_PYTHON = "/usr/bin/python3"
START = 20.0
"""s that the two processes of a pair have to find each other"""
LOOK = 0.2
"""s between two checks that both sides are still alive"""
NANOSECONDS = 1e9


class Sizes(NamedTuple):
    """Bytes of hilrig's messages."""

    state: int
    command: int


@dataclass(frozen=True)
class Transport:
    """A transport that hilrig's bus is compared with."""

    name: str
    script: str
    """File in peers/, without its suffix"""
    title: str
    module: str = ""
    """Modules that its script imports and hilrig does not depend on; "" for none"""
    install: str = ""
    """How to install that"""
    fifo: bool = True
    """Whether the pair finishes with both processes under SCHED_FIFO on one core"""


GROUP = "run: uv run --group bench python -m benchmarks"
TRANSPORTS = (
    Transport("zenoh", "zenoh_pair", "zenoh, bare"),
    Transport("unix_datagram", "unix_datagram", "unix datagram sockets"),
    Transport("pyzmq", "pyzmq_pair", "pyzmq, PAIR over ipc", "zmq", GROUP),
    Transport("lcm", "lcm_pair", "LCM, UDP multicast", "lcm", GROUP),
    Transport(
        "rospy", "rospy_pair", "rospy, TCP (never SCHED_FIFO)", "rospy, rosmaster, std_msgs.msg",
        "apt install python3-rospy python3-rosmaster python3-std-msgs", fifo=False,
    ),
)  # fmt: skip


@cache
def python_for(transport: Transport) -> str | None:
    """Return a Python with the modules of the transport: this one, or else the system's; None if neither has them."""
    if not transport.module:
        return sys.executable
    for python in (sys.executable, SYSTEM_PYTHON):
        try:
            found = subprocess.run([python, "-c", f"import {transport.module}"], capture_output=True, timeout=START)
        except (OSError, subprocess.TimeoutExpired):
            continue
        if found.returncode == 0:
            return python
    return None


def round_trips(transport: Transport, sizes: Sizes, place: Placement, count: int, period: float) -> dict[str, float]:
    """Return rate_hz and round_trip_{p50,p99,max}_us of `count` round trips, one each `period` (s); 0: back to back.

    A request has the size of a State, a reply that of a Command. Raises RigError if the pair fails.
    """
    python = python_for(transport)
    if python is None:
        raise RigError(f"not installed; {transport.install}")
    if place.policy == "fifo" and not transport.fifo:
        place = Placement(place.core, "other", 0)
    orders = {
        **place._asdict(), "request": sizes.state, "reply": sizes.command, "count": count,
        "warm_up": max(count // 10, 1), "period": round(period * NANOSECONDS),
        "spin": round(RigSettings().spin * NANOSECONDS),
    }  # fmt: skip
    patience = START + 3 * count * max(period, 1e-3)
    folder = tempfile.mkdtemp(prefix="bench-")
    try:
        with _surroundings(transport, python) as more:
            printed = _run_pair([python, str(SCRIPT), transport.script], {**orders, "folder": folder}, more, patience)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    result = json.loads(printed)
    p50, p99, largest = np.percentile(result["round_trips"], [50, 99, 100]) / 1e3
    return {
        "rate_hz": count / result["elapsed"] * NANOSECONDS,
        "round_trip_p50_us": float(p50), "round_trip_p99_us": float(p99), "round_trip_max_us": float(largest),
    }  # fmt: skip


def _run_pair(command: list[str], orders: Mapping[str, Any], more: Mapping[str, str], patience: float) -> str:
    """Run both sides until they end; return what the pinging side printed."""
    environment = {**os.environ, **CHILD_ENVIRONMENT, **more}
    sides: dict[str, subprocess.Popen[str]] = {}
    try:
        for side in ("echo", "ping"):
            sides[side] = subprocess.Popen(
                [*command, json.dumps({**orders, "side": side})], stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
            )  # fmt: skip
        printed, errors = _outputs(sides["ping"], sides["echo"], patience)
        if sides["ping"].returncode != 0:
            raise RigError(f"exit code {sides['ping'].returncode}{_last_line(errors)}")
        return printed
    finally:
        _kill(sides.values())
        for process in sides.values():
            process.communicate()


def _outputs(ping: subprocess.Popen[str], echo: subprocess.Popen[str], patience: float) -> tuple[str, str]:
    """Return stdout and stderr of the pinging side once it has ended. Raises RigError if it does not end."""
    deadline = time.monotonic() + patience
    while True:
        try:
            return ping.communicate(timeout=LOOK)
        except subprocess.TimeoutExpired:
            if not echo.poll() and time.monotonic() < deadline:
                continue
        ended = f"the echoing side ended with exit code {echo.returncode}"
        how = ended if echo.poll() else f"not finished after {patience:.0f} s"
        _kill((ping, echo))
        raise RigError(how + _last_line(echo.communicate()[1]))


def _kill(processes: Iterable[subprocess.Popen[str]]) -> None:
    """Kill all of them before waiting for any: one may occupy the core that another needs to exit."""
    for process in processes:
        process.kill()


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return f": {lines[-1]}" if lines else ""


@contextmanager
def _surroundings(transport: Transport, python: str) -> Iterator[dict[str, str]]:
    """Provide what else the transport needs, as environment variables: for rospy, a separate master."""
    if transport.name != "rospy":
        yield {}
        return
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    home = tempfile.mkdtemp(prefix="bench-ros-")
    more = {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1", "ROS_HOME": home, "ROS_LOG_DIR": home}
    start = f"import rosmaster; rosmaster.rosmaster_main(['rosmaster', '--core', '-p', '{port}'])"
    null = subprocess.DEVNULL
    master = subprocess.Popen(
        [python, "-c", start], env={**os.environ, **more}, stdin=null, stdout=null, stderr=null, start_new_session=True
    )
    try:
        _wait_for_port(port)
        yield more
    finally:
        master.kill()
        master.wait()
        shutil.rmtree(home, ignore_errors=True)


def _wait_for_port(port: int) -> None:
    deadline = time.monotonic() + START
    while time.monotonic() < deadline:
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
            return
        except OSError:
            time.sleep(0.05)
    raise RigError(f"the ROS master did not start within {START:g} s")
