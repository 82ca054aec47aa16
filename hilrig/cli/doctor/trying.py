"""What is found out of a machine only by trying it, or by asking others."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from hilrig.cli.doctor.host import Tried

_TRY_FIFO = (
    "import sys; from hilrig.rig.scheduling import schedule; print(*schedule('fifo', int(sys.argv[1])), sep='|')"
)


def try_things(priority: int) -> Tried:
    """Try SCHED_FIFO at `priority` in a process of its own, and ask for virtual machine, zenoh and ROS."""
    return Tried(
        fifo=_refusal(_printed([sys.executable, "-P", "-c", _TRY_FIFO, str(priority)])),
        virtual_machine=_kind("--vm"),
        container=_kind("--container"),
        zenoh=metadata.version("eclipse-zenoh"),
        ros=_ros(),
    )


def _printed(command: list[str]) -> str:
    """Return what a command prints; empty if it is not there."""
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False).stdout.strip()
    except (OSError, subprocess.TimeoutExpired):
        return ""


def _refusal(said: str) -> str:
    """Return why SCHED_FIFO was refused, from "what it has now|why not what was wanted"."""
    now, bar, reason = said.partition("|")
    return reason if bar else f"the trial of it failed {now}".rstrip()


def _kind(option: str) -> str:
    found = _printed(["systemd-detect-virt", option])
    return "" if found == "none" else found


def _ros() -> tuple[str, ...]:
    """Return the distributions of ROS that are installed, and which client library Python finds here.

    A distribution of its own is a folder in /opt/ros; Debian packages ROS 1 without one.
    """
    found = [path.name for path in sorted(Path("/opt/ros").glob("*")) if path.is_dir()]
    sourced = os.environ.get("ROS_DISTRO", "")
    installed = [f"{name} (sourced)" if name == sourced else name for name in dict.fromkeys([*found, sourced]) if name]
    if shutil.which("rosmaster") and not found:
        installed.append("ROS 1 of this system")
    libraries = {"rospy": "rospy (ROS 1) importable", "rclpy": "rclpy (ROS 2) importable"}
    return (*installed, *(text for module, text in libraries.items() if find_spec(module)))
