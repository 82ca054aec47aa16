"""A plant that is not simulated, over the real bus: connected once, held before it is closed, closed once, always."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from helpers.counting_driver import calls, outcome_of, whats
from helpers.patience import wait_for
from helpers.real_rig import LONG, end_of, faulty, rig_processes

from hilrig.recording.bag import read_bag
from hilrig.recording.run_directory import read_driver_record

WHOLE = ["connect", "prepare", "approach", "retract", "hold", "close"]
TRACE = ("connect", "hold", "close")


def once_held_then_closed(folder: Path) -> None:
    """Assert that the plant was connected once, and held at least once before it was closed once."""
    names = [call.what for call in calls(folder) if call.what in TRACE]
    assert names.count("connect") == names.count("close") == 1, names
    assert names[-2:] == ["hold", "close"], names
    assert len({call.pid for call in calls(folder)}) == 1


def running(folder: Path) -> Callable[[], bool]:
    """Return a condition: the plant has approached, so the ticks run or are about to."""
    return lambda: "approach" in whats(folder)


def test_a_whole_life(hilrig, robot, tmp_path: Path) -> None:
    done = hilrig("run", robot(), "--no-report")
    assert done.returncode == 0, done.stderr
    assert whats(tmp_path) == WHOLE
    once_held_then_closed(tmp_path)
    bag = read_bag(next((tmp_path / "runs").glob("*/trials/*/bag.mcap")))
    assert list(bag["stages"]["stage"]) == [1] * 3 + [2] * 3 + [4] * 3
    assert list(bag["stages"]["target"][3:6]) == [3.5] * 3
    assert bag["state"]["tick"][0] == 0


@pytest.mark.parametrize(
    ("step", "words"),
    [
        ("raise RuntimeError('no idea')", "controller: RuntimeError: no idea"),
        ("raise SystemExit(0)", "sys.exit(0) was called"),
        ("return torque * np.nan", "is not finite"),
        ("os._exit(3)", "the controller process ended with exit code 3"),
        ("os.kill(os.getpid(), 9)", "the controller process was killed by SIGKILL"),
        ("os.kill(os.getpid(), 19)", "safety.command_age"),
        ("time.sleep(1000)", "safety.command_age"),
    ],
)
def test_whatever_a_law_does_the_plant_is_held(hilrig, robot, tmp_path: Path, step: str, words: str) -> None:
    done = hilrig("run", robot(duration=LONG, controllers=faulty(tmp_path, step)), "--no-report")
    assert done.returncode == 1
    once_held_then_closed(tmp_path)
    outcome = outcome_of(tmp_path)
    assert outcome["outcome"] in ("failed", "tripped")
    assert words in outcome["reason"], outcome


@pytest.mark.parametrize("role", ["controller", "logger"])
def test_a_killed_process(start, robot, tmp_path: Path, role: str) -> None:
    program = start("run", robot(duration=LONG), "--no-report")
    wait_for(running(tmp_path))
    rig_processes(tmp_path)[role].kill()
    end_of(program)
    once_held_then_closed(tmp_path)
    assert f"the {role} process was killed by SIGKILL" in outcome_of(tmp_path)["reason"]


@pytest.mark.parametrize(
    "signals", [[signal.SIGINT], [signal.SIGINT] * 3, [signal.SIGTERM], [signal.SIGINT, signal.SIGTERM]], ids=str
)
def test_ctrl_c_and_sigterm_however_often(start, robot, tmp_path: Path, signals: list[signal.Signals]) -> None:
    """The plant takes half a second to hold, and nothing cuts that short."""
    program = start("run", robot(duration=LONG, hold="time.sleep(0.5); note('held')"), "--no-report")
    wait_for(running(tmp_path))
    for number in signals:
        program.send_signal(number)
        time.sleep(0.1)
    _, stderr = end_of(program)
    assert program.returncode == 130
    assert "Traceback" not in stderr
    names = whats(tmp_path)
    assert names[-3:] == ["hold", "held", "close"], names
    assert outcome_of(tmp_path)["outcome"] == "aborted"


def test_a_supervisor_that_is_killed(start, robot, tmp_path: Path) -> None:
    program = start("run", robot(duration=LONG, hold="time.sleep(0.3); note('held')"), "--no-report")
    wait_for(running(tmp_path))
    os.kill(program.pid, signal.SIGKILL)
    wait_for(lambda: not rig_processes(tmp_path))
    assert whats(tmp_path)[-3:] == ["hold", "held", "close"]
    # Nobody was left to be told; the driver's own record says how it ended.
    record = read_driver_record(next((tmp_path / "runs").glob("*/trials/*")))
    assert (record["outcome"], record["reason"]) == ("aborted", "the supervisor is gone")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1])
def test_a_signal_to_the_driver(start, robot, tmp_path: Path, number: signal.Signals) -> None:
    program = start("run", robot(duration=LONG), "--no-report")
    wait_for(running(tmp_path))
    driver = rig_processes(tmp_path)["driver"]
    driver.send_signal(number)
    end_of(program)
    once_held_then_closed(tmp_path)


@pytest.mark.parametrize("place", ["prepare", "approach", "retract", "measure", "advance"])
def test_whatever_the_plant_raises_it_is_held(hilrig, robot, tmp_path: Path, place: str) -> None:
    raising = "if len(open(CALLS).readlines()) > 1: raise OSError('the cable is out')"
    assert hilrig("run", robot(**{place: raising}), "--no-report").returncode == 1
    once_held_then_closed(tmp_path)
    assert "the cable is out" in outcome_of(tmp_path)["reason"]


def test_a_plant_that_cannot_be_connected_is_neither_held_nor_closed(hilrig, robot, tmp_path: Path) -> None:
    assert hilrig("run", robot(connect="raise OSError('no answer')"), "--no-report").returncode == 1
    assert whats(tmp_path) == ["connect"]
    assert "no answer" in outcome_of(tmp_path)["reason"]


def test_a_plant_that_cannot_be_held_is_closed_and_says_so(hilrig, robot, tmp_path: Path) -> None:
    assert hilrig("run", robot(hold="raise OSError('stuck')"), "--no-report").returncode == 1
    once_held_then_closed(tmp_path)
    assert "hold raised OSError: stuck: look at the arm" in outcome_of(tmp_path)["reason"]


def test_a_plant_that_cannot_be_held_after_ctrl_c_says_so(start, robot, tmp_path: Path) -> None:
    program = start("run", robot(duration=LONG, hold="raise OSError('stuck')"), "--no-report")
    wait_for(running(tmp_path))
    program.send_signal(signal.SIGINT)
    _, stderr = end_of(program)
    once_held_then_closed(tmp_path)
    outcome = outcome_of(tmp_path)
    assert outcome["outcome"] == "failed"
    assert "hold raised OSError: stuck: look at the arm" in outcome["reason"]
    assert "look at the arm" in stderr


def test_an_arm_that_is_not_at_the_start_is_refused_with_both_values(hilrig, robot, tmp_path: Path) -> None:
    assert hilrig("run", robot(off="0.1"), "--no-report").returncode == 1
    reason = outcome_of(tmp_path)["reason"]
    assert "the arm is not where the trial starts: joint 1 is at" in reason
    assert "safety.start_tolerance" in reason
    assert whats(tmp_path) == ["connect", "prepare", "hold", "close"]


def test_a_stage_that_does_not_end_times_out(hilrig, robot, tmp_path: Path) -> None:
    endless = "while True: yield Progress('pushing', 1.2, 3.5, 'N')"
    safety = "safety: {command_age: 3 s, approach_timeout: 0.3 s}"
    assert hilrig("run", robot(approach=endless, safety=safety), "--no-report").returncode == 1
    outcome = outcome_of(tmp_path)
    assert outcome["outcome"] == "timed_out"
    assert outcome["reason"] == "approach took more than 0.3 s (safety.approach_timeout): pushing, 1.2 N of 3.5 N"
    once_held_then_closed(tmp_path)


def test_a_robot_is_not_run_in_one_process(hilrig, robot, tmp_path: Path) -> None:
    done = hilrig("run", robot(), "--no-report", "--in-process")
    assert done.returncode == 2
    assert "--in-process" in done.stderr
    assert whats(tmp_path) == []
