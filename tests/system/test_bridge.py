"""A robot behind a bridge, over the real bus: one process owns it for the whole run, and holds it whatever dies."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from helpers.bridged import bridged_driver, fault, robot_calls, robot_side
from helpers.guides import DOCS, write_files
from helpers.patience import wait_for
from helpers.ports import free_port
from helpers.real_rig import LONG, end_of, faulty, only_run, rig_processes
from hilrig_drivers import bridge
from hilrig_drivers.bridge_client import BridgeSettings, RobotBridge

from hilrig import HilrigError

AGE = 3.0
"""s, of the bridge's watchdog: the standstills of a busy machine seldom wake it"""


@pytest.fixture
def bridged(experiment: Callable[..., Path], tmp_path: Path) -> Callable[..., Path]:
    """Write an experiment on a robot behind a bridge and return its path."""

    def write(
        duration: float = 0.3, trials: int = 1, age: float = AGE, python: str = sys.executable, period: str = "10 ms",
        **changes: str,
    ) -> Path:  # fmt: skip
        kind = bridged_driver(tmp_path, python, **changes)
        law = faulty(tmp_path, "pass", when="False").removeprefix("faulty: ")
        path = experiment(
            clock="realtime", driver=kind, duration=duration, name="bridged",
            controllers="\n  ".join(f"still{k}: {law}" for k in range(trials)),
            safety="safety: {command_age: 5 s, sample_age: 5 s}",
        )  # fmt: skip
        text = path.read_text().replace(
            "  surface: {position: 0.35 m, stiffness: 800 N/m, damping: 20 N*s/m, friction: 0.2}\n", f"  age: {age} s\n"
        )
        path.write_text(text.replace("clock: realtime\n", f"clock: realtime\nperiod: {period}\n"))
        return path

    return write


def whats(folder: Path) -> list[str]:
    """Return what the robot was told, repeated moves once."""
    names = [what for what, *_ in robot_calls(folder)]
    return [name for i, name in enumerate(names) if i == 0 or names[i - 1] != name]


def lived(folder: Path, told: list[str]) -> None:
    """Wait until the bridge has ended, and assert what the robot was told."""
    wait_for(gone(bridge_process(folder)))
    assert whats(folder) == told


def moving(folder: Path) -> Callable[[], bool]:
    return lambda: "move" in whats(folder)


def bridge_process(folder: Path) -> psutil.Process:
    """Return the process that owns the robot."""
    return psutil.Process(robot_calls(folder)[0][2])


def gone(process: psutil.Process) -> Callable[[], bool]:
    return lambda: not process.is_running() or process.status() == psutil.STATUS_ZOMBIE


def outcomes(folder: Path) -> list[dict[str, Any]]:
    """Return the outcomes of the trials, in their order."""
    files = sorted(only_run(folder).glob("trials/*/outcome.json"))
    return [json.loads(file.read_text()) for file in files]


def test_one_bridge_owns_the_robot_for_the_whole_run(hilrig, bridged, tmp_path: Path) -> None:
    done = hilrig("run", bridged(trials=3), "--no-report")
    assert done.returncode == 0, done.stderr
    lived(tmp_path, ["begin", *["move", "hold"] * 3, "close"])
    assert len({pid for _, _, pid, _ in robot_calls(tmp_path)}) == 1
    log = next(only_run(tmp_path).glob("trials/*/logs/driver.log")).read_text()
    assert "Traceback" not in log
    # Neither a socket nor a log is left.
    assert not Path(fault(tmp_path, "at").read_text()).parent.exists()


def test_the_driver_is_killed_the_bridge_holds_and_the_next_trial_goes_on(start, bridged, tmp_path: Path) -> None:
    program = start("run", bridged(duration=2.0, trials=2), "--no-report")
    wait_for(moving(tmp_path))
    rig_processes(tmp_path)["driver"].kill()
    end_of(program)
    lived(tmp_path, ["begin", "move", "hold", "move", "hold", "close"])
    first, second = outcomes(tmp_path)
    assert "killed by SIGKILL" in first["reason"]
    assert second["outcome"] == "completed"
    moves = [when for what, when, _, _ in robot_calls(tmp_path) if what == "move"]
    held = next(when for what, when, _, _ in robot_calls(tmp_path) if what == "hold")
    last = max(when for when in moves if when < held)
    assert held - last <= AGE + 1.0


@pytest.mark.parametrize("also", [(), ("driver",)], ids=["program", "and the driver"])
def test_the_program_is_killed_and_the_bridge_holds_closes_and_ends(
    start, bridged, tmp_path: Path, also: tuple[str, ...]
) -> None:
    program = start("run", bridged(duration=LONG), "--no-report")
    wait_for(moving(tmp_path))
    others = rig_processes(tmp_path)
    program.kill()
    for role in also:
        others[role].kill()
    lived(tmp_path, ["begin", "move", "hold", "close"])


def test_a_driver_that_is_stopped(start, bridged, tmp_path: Path) -> None:
    program = start("run", bridged(duration=LONG, age=0.5), "--no-report")
    wait_for(moving(tmp_path))
    driver = rig_processes(tmp_path)["driver"]
    driver.suspend()
    wait_for(lambda: whats(tmp_path)[-1] == "hold")
    driver.resume()
    end_of(program)
    lived(tmp_path, ["begin", "move", "hold", "close"])
    (outcome,) = outcomes(tmp_path)
    assert outcome["outcome"] == "tripped"


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("silent", "no sample of the robot for"),
        ("broken", "read raised OSError: the sensor is unplugged"),
        ("nan", "the robot gave a sample that is not finite"),
        ("runstop", "the runstop is pressed"),
    ],
)
def test_the_robot_is_in_trouble(start, bridged, tmp_path: Path, what: str, words: str) -> None:
    program = start("run", bridged(duration=LONG), "--no-report")
    wait_for(moving(tmp_path))
    fault(tmp_path, what).touch()
    end_of(program)
    lived(tmp_path, ["begin", "move", "hold", "close"])
    (outcome,) = outcomes(tmp_path)
    assert outcome["outcome"] == "tripped", outcome
    assert f"the bridge holds the robot: {words}" in outcome["reason"]


def test_a_robot_that_cannot_be_held_is_told(start, bridged, tmp_path: Path) -> None:
    program = start("run", bridged(duration=LONG), "--no-report")
    wait_for(moving(tmp_path))
    fault(tmp_path, "stuck").touch()
    program.send_signal(signal.SIGINT)
    end_of(program)
    (outcome,) = outcomes(tmp_path)
    assert "the bridge cannot hold the robot: hold raised OSError: the brake does not answer" in outcome["reason"]
    assert outcome["reason"].endswith("look at the arm")
    wait_for(gone(bridge_process(tmp_path)))


def test_a_robot_in_trouble_is_not_attached_to(hilrig, bridged, tmp_path: Path) -> None:
    fault(tmp_path, "runstop").touch()
    assert hilrig("run", bridged(), "--no-report").returncode == 1
    (outcome,) = outcomes(tmp_path)
    assert outcome["outcome"] == "failed"
    assert "refuses: the runstop is pressed" in outcome["reason"]
    lived(tmp_path, ["begin", "close"])


def test_the_bridge_is_killed(start, bridged, tmp_path: Path) -> None:
    program = start("run", bridged(duration=LONG), "--no-report", "--set", "safety.sample_age=1 s")
    wait_for(moving(tmp_path))
    bridge_process(tmp_path).kill()
    end_of(program)
    (outcome,) = outcomes(tmp_path)
    assert "safety.sample_age" in outcome["reason"]
    assert "does not answer within" in outcome["reason"]
    assert outcome["reason"].endswith("look at the arm")


def test_halt_reaches_the_bridge(start, hilrig, bridged, tmp_path: Path) -> None:
    program = start("run", bridged(duration=LONG), "--no-report")
    wait_for(moving(tmp_path))
    done = hilrig("halt", "--below", tmp_path)
    end_of(program)
    assert done.returncode == 0, done.stderr
    assert f"held     bridge to {tmp_path / 'robot_side.py'}" in done.stdout
    lived(tmp_path, ["begin", "move", "hold", "close"])
    (outcome,) = outcomes(tmp_path)
    assert "halted by hilrig halt" in outcome["reason"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_the_bridge(start, bridged, tmp_path: Path, number: signal.Signals) -> None:
    program = start("run", bridged(duration=LONG), "--no-report")
    wait_for(moving(tmp_path))
    bridge = bridge_process(tmp_path)
    bridge.send_signal(number)
    end_of(program)
    assert f"the bridge was told to end ({number.name})" in outcomes(tmp_path)[0]["reason"]
    lived(tmp_path, ["begin", "move", "hold", "close"])


def test_what_is_beyond_the_robots_limits_never_reaches_it(hilrig, bridged, tmp_path: Path) -> None:
    """The driver is wrong here: hilrig's own envelope is in front of it."""
    jump = "command.position + (0.5 if self.number > 30 else 0.0)"
    assert hilrig("run", bridged(reference=jump, duration=1.0), "--no-report").returncode == 1
    (outcome,) = outcomes(tmp_path)
    assert "joint 1 was asked for a step of 0.5 rad in" in outcome["reason"]
    assert np.ptp([q for _, _, _, q in robot_calls(tmp_path)], axis=0).max() < 0.1
    lived(tmp_path, ["begin", "move", "hold", "close"])


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        ("import rospy_that_nobody_has", "ModuleNotFoundError: No module named 'rospy_that_nobody_has'"),
        ("raise SystemExit('start the master first')", "start the master first"),
    ],
)
def test_a_bridge_that_cannot_begin_says_why(hilrig, bridged, tmp_path: Path, broken: str, words: str) -> None:
    path = bridged()
    side = tmp_path / "robot_side.py"
    side.write_text(side.read_text().replace("import json\n", f"import json\n{broken}\n", 1))
    assert hilrig("run", path, "--no-report").returncode == 1
    (outcome,) = outcomes(tmp_path)
    assert f"the bridge ended with exit code 1: {words}" in outcome["reason"]
    assert "look at the arm" not in outcome["reason"]


def test_an_interpreter_that_is_not_there(hilrig, bridged, tmp_path: Path) -> None:
    assert hilrig("run", bridged(python="/usr/bin/python2.7"), "--no-report").returncode == 1
    assert "/usr/bin/python2.7: No such file" in outcomes(tmp_path)[0]["reason"]


def test_the_interpreter_of_the_machine_with_nothing_of_hilrigs(hilrig, bridged, tmp_path: Path) -> None:
    """The bridge needs nothing but the standard library; on a robot's machine that is Python 3.8."""
    done = hilrig("run", bridged(python=os.environ.get("BRIDGE_PYTHON", "/usr/bin/python3")), "--no-report")
    assert done.returncode == 0, done.stderr
    lived(tmp_path, ["begin", "move", "hold", "close"])


def test_all_orders_of_a_suspended_bridge_are_old(start, bridged, tmp_path: Path) -> None:
    program = start("run", bridged(duration=LONG, age=0.5), "--no-report")
    wait_for(moving(tmp_path))
    bridge = bridge_process(tmp_path)
    bridge.suspend()
    time.sleep(1.0)
    bridge.resume()
    end_of(program)
    wait_for(gone(bridge))
    calls = robot_calls(tmp_path)
    assert [what for what, *_ in calls][-2:] == ["hold", "close"]
    after = [what for what, when, *_ in calls if when > calls[-2][1]]
    assert "move" not in after


def settings(folder: Path, **changes: Any) -> BridgeSettings:
    return BridgeSettings(
        str(robot_side(folder)), settings={"calls": str(folder / "robot.txt")}, order_age=1.0, **changes
    )  # fmt: skip


def test_a_second_driver_does_not_get_the_robot_and_a_later_one_does(tmp_path: Path) -> None:
    first = RobotBridge(settings(tmp_path), 2)
    with pytest.raises(HilrigError, match="refuses: another program has the robot"):
        RobotBridge(settings(tmp_path), 2)
    first.close()
    with pytest.raises(HilrigError, match="refuses: the robot has 2 joints, not 3"):
        RobotBridge(settings(tmp_path), 3)
    last = RobotBridge(settings(tmp_path), 2)
    assert last.wait(1.0)
    end(last, tmp_path)
    assert whats(tmp_path) == ["begin", "close"]


def test_a_bridge_with_other_settings_is_ended_before_another_one_begins(tmp_path: Path) -> None:
    first = RobotBridge(settings(tmp_path), 2)
    first.close()
    second = RobotBridge(settings(tmp_path, sample_age=0.5), 2)
    end(second, tmp_path)
    assert whats(tmp_path) == ["begin", "close", "begin", "close"]
    assert robot_calls(tmp_path)[1][2] != robot_calls(tmp_path)[2][2]


def test_a_bridge_that_does_not_end_keeps_the_robot_to_itself(tmp_path: Path) -> None:
    RobotBridge(settings(tmp_path), 2).close()
    fault(tmp_path, "busy").touch()
    with pytest.raises(HilrigError, match=r"has other settings and does not end within 0.5 s"):
        RobotBridge(settings(tmp_path, sample_age=0.5, start_time=0.5), 2)
    fault(tmp_path, "busy").unlink()
    wait_for(lambda: "close" in whats(tmp_path))
    bridge_process(tmp_path).wait(10)
    assert whats(tmp_path) == ["begin", "close"]


def test_a_bridge_that_cannot_be_reached_is_not_started_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("secrets.randbits", lambda bits: 7)
    first = RobotBridge(settings(tmp_path), 2)
    with pytest.raises(HilrigError, match=r"cannot be reached: .*in use"):
        RobotBridge(settings(tmp_path), 2)
    end(first, tmp_path)
    assert whats(tmp_path) == ["begin", "close"]


def test_a_bridge_whose_owner_is_gone_before_it_begins(tmp_path: Path) -> None:
    gone_already = subprocess.Popen(["true"])
    gone_already.wait()
    words = [str(robot_side(tmp_path)), "--at", f"127.0.0.1:{free_port()}", "--owner", str(gone_already.pid)]
    done = subprocess.run(
        [sys.executable, bridge.__file__, *words, "--set", f"calls={tmp_path / 'robot.txt'}"], timeout=20
    )
    assert done.returncode == 0
    assert whats(tmp_path) == ["begin", "close"]


def test_a_bridge_that_somebody_has_started_on_a_port(tmp_path: Path) -> None:
    at = f"127.0.0.1:{free_port()}"
    calls = tmp_path / "robot.txt"
    words = [str(robot_side(tmp_path)), "--at", at, "--order-age", "1", "--set", f"calls={calls}"]
    program = subprocess.Popen([sys.executable, bridge.__file__, *words])
    wait_for(calls.exists)
    arm = RobotBridge(settings(tmp_path, at=at), 2)
    arm.wait(1.0)
    arm.move(arm.position + 0.01)
    wait_for(moving(tmp_path))
    arm.hold()
    arm.close()
    program.terminate()
    assert program.wait(10) == 0
    assert whats(tmp_path) == ["begin", "move", "hold", "close"]


def test_nobody_answers_on_a_port(tmp_path: Path) -> None:
    with pytest.raises(HilrigError, match=r"the bridge at 127.0.0.1:\d+ does not answer within 0.5 s"):
        RobotBridge(settings(tmp_path, at=f"127.0.0.1:{free_port()}", start_time=0.5), 2)


def end(arm: RobotBridge, folder: Path) -> None:
    """Let go of the robot and end its bridge, which belongs to the tests' own process."""
    arm.close()
    for pid in {pid for _, _, pid, _ in robot_calls(folder)}:
        with suppress(psutil.NoSuchProcess):
            process = psutil.Process(pid)
            process.terminate()
            process.wait(10)


def test_the_example_of_the_guide(hilrig, bridged, tmp_path: Path) -> None:
    assert {"my_robot.py", "my_arm.py"} <= set(write_files(DOCS / "drivers.md", tmp_path))
    path = bridged()
    arm = f"  kind: ./my_arm.py\n  python: {sys.executable}\n"
    path.write_text(path.read_text().replace("  kind: ./bridged.py\n", arm).replace(f"  age: {AGE} s\n", ""))
    driver = tmp_path / "my_arm.py"
    patient = f'{{"host": self.host}}, order_age={AGE}, sample_age={AGE})'  # a busy machine stands still now and then
    driver.write_text(driver.read_text().replace('{"host": self.host})', patient))
    side = tmp_path / "my_robot.py"  # stand it where the trial starts
    side.write_text(side.read_text().replace("[0.9, 0.6]", "[0.987, 1.839]"))
    done = hilrig("run", path, "--no-report")
    assert done.returncode == 0, done.stderr
