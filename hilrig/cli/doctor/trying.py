"""Properties of a machine that can only be found by trying, or by asking other programs."""

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
    """Try SCHED_FIFO at `priority` in a separate process; look for a virtual machine, zenoh and ROS."""
    return Tried(
        fifo=_refusal(_printed([sys.executable, "-P", "-c", _TRY_FIFO, str(priority)])),
        virtual_machine=_kind("--vm"),
        container=_kind("--container"),
        zenoh=metadata.version("eclipse-zenoh"),
        ros=_ros(),
    )


def _printed(command: list[str]) -> str:
    """Return what a command prints; empty if it does not exist, or takes too long."""
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False).stdout.strip()
    except (OSError, subprocess.TimeoutExpired):
        return ""


def _refusal(said: str) -> str:
    """Return why SCHED_FIFO was refused, from "policy now|reason"; empty if it was not."""
    now, bar, reason = said.partition("|")
    return reason if bar else f"it could not be tried {now}".rstrip()


def _kind(option: str) -> str:
    found = _printed(["systemd-detect-virt", option])
    return "" if found == "none" else found


def _ros() -> tuple[str, ...]:
    """Return the installed distributions of ROS, and the client libraries that this Python finds.

    A distribution is a folder in /opt/ros; Debian's own packages of ROS 1 have none.
    """
    found = [path.name for path in sorted(Path("/opt/ros").glob("*")) if path.is_dir()]
    sourced = os.environ.get("ROS_DISTRO", "")
    installed = [f"{name} (sourced)" if name == sourced else name for name in dict.fromkeys([*found, sourced]) if name]
    if shutil.which("rosmaster") and not found:
        installed.append("ROS 1 of this system")
    libraries = {"rospy": "rospy (ROS 1) importable", "rclpy": "rclpy (ROS 2) importable"}
    return (*installed, *(text for module, text in libraries.items() if find_spec(module)))
