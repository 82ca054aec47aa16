"""The example of a robot of one's own: the shipped driver, on a simulated robot that lives in a process of its own."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.patience import wait_for
from helpers.ports import free_port
from helpers.real_rig import PROJECT, end_of, only_run, rig_processes, under_way

from hilrig.recording.bag import read_bag

EXPERIMENT = PROJECT / "experiments" / "udp_arm.yaml"
LATE = ("--set", "timing={late_fraction: 100 %, command_age_p99: 100 s}", "--set", "safety.command_age=3 s",
        "--set", "safety.sample_age=3 s", "--set", "safety.joint_velocity=20")  # fmt: skip
"""The standstills of a busy machine are no concern of these tests"""


@pytest.fixture
def robot() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Switch a robot on; it is off at the end of the test."""
    on: list[subprocess.Popen[str]] = []

    def switch_on(*options: str) -> tuple[subprocess.Popen[str], str]:
        port = str(free_port())
        program = str(PROJECT / "experiments" / "udp_robot.py")
        process = subprocess.Popen(
            [sys.executable, program, "--port", port, *options], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True,
        )  # fmt: skip
        on.append(process)
        assert process.stdout is not None
        assert "the robot is on" in process.stdout.readline()
        return process, f"driver.port={port}"

    yield switch_on  # type: ignore[misc]
    for process in on:
        process.kill()
        process.communicate()


def trials(under: Path) -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """Return outcome and bag of each trial."""
    return {
        path.parent.name: (json.loads(path.read_text()), read_bag(path.parent / "bag.mcap"))
        for path in only_run(under).glob("trials/*/outcome.json")
    }


def test_its_samples_begin_the_ticks_and_the_law_is_called_on_fresh_ones(hilrig, robot, tmp_path: Path) -> None:
    _, port = robot("--dropouts", "0.2")
    short = ("--set", "phases.0.duration=1 s", "--set", "phases.1.duration=1 s", "--set", port)
    done = hilrig("run", EXPERIMENT, "--no-report", *short, *LATE)
    assert done.returncode == 0, done.stderr
    for outcome, bag in trials(tmp_path).values():
        assert outcome["outcome"] == "completed"
        assert set(outcome["stages"]) == {"connect", "prepare", "approach", "ticks", "retract"}
        state, command = bag["state"], bag["command"]
        stale = set(state["tick"][state["fresh"] == 0].tolist())
        assert 0 < len(stale) < 100
        assert (np.diff(state["stamp"][state["fresh"] == 1]) > 0).all()
        for row in range(1, len(command["tick"])):
            same = np.array_equal(command["asked"][row], command["asked"][row - 1])
            assert same == (command["tick"][row] in stale), row
        assert set(bag["stages"]["stage"]) == {1, 2, 4}


def test_without_a_robot_it_says_what_to_do(hilrig, tmp_path: Path) -> None:
    done = hilrig("run", EXPERIMENT, "--no-report", "--set", f"driver.port={free_port()}")
    assert done.returncode == 1
    for outcome, _ in trials(tmp_path).values():
        assert outcome["outcome"] == "failed"
        assert "start the simulated one with: python experiments/udp_robot.py" in outcome["reason"]


def test_a_robot_that_is_switched_off_is_told_with_what_was_noticed_first(start, robot, tmp_path: Path) -> None:
    process, port = robot()
    program = start("run", EXPERIMENT, "--no-report", "--fail-fast", "--set", port)
    wait_for(under_way(tmp_path))
    process.send_signal(signal.SIGKILL)
    end_of(program)
    (outcome, _), *others = trials(tmp_path).values()
    assert (outcome["outcome"], others) == ("failed", [])
    assert "safety.sample_age" in outcome["reason"]
    assert "hold raised HilrigError: no robot at" in outcome["reason"]
    assert outcome["reason"].endswith("look at the arm")


def test_a_second_program_does_not_get_a_robot_that_is_held_by_another(start, hilrig, robot, tmp_path: Path) -> None:
    _, port = robot()
    program = start("run", EXPERIMENT, "--no-report", "--set", port, *LATE)
    wait_for(under_way(tmp_path))
    done = hilrig("run", EXPERIMENT, "--no-report", "--fail-fast", "--set", port, "--out", "second")
    assert "or another program has it" in done.stderr
    assert "driver" in rig_processes(tmp_path)
    program.send_signal(signal.SIGINT)
    end_of(program)
    assert program.returncode == 130
