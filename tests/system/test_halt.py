"""hilrig halt: every plant is held and closed, every run ends, and what cannot be held is named."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import pytest
from helpers.counting_driver import calls, outcome_of
from helpers.patience import wait_for
from helpers.real_rig import LONG, end_of, rig_processes, under_way


@pytest.fixture
def halt(hilrig, tmp_path: Path):
    """Halt this test's rigs only: other tests run beside it."""
    return lambda *options: hilrig("halt", "--below", tmp_path, *options)


def held_then_closed(folder: Path) -> bool:
    return [call.what for call in calls(folder)][-2:] == ["hold", "close"]


def test_a_plant_is_held_and_the_run_starts_no_further_trial(start, halt, robot, tmp_path: Path) -> None:
    program = start("run", robot(duration=LONG, controllers="pd: {kind: pd}\n  more: {kind: pd}"), "--no-report")
    wait_for(lambda: "approach" in [call.what for call in calls(tmp_path)])
    done = halt()
    end_of(program)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("held     trial pd.noisy.0 of ")
    assert program.returncode == 130
    assert held_then_closed(tmp_path)
    outcome = outcome_of(tmp_path)
    assert (outcome["outcome"], outcome["reason"]) == ("aborted", "halted by hilrig halt")
    assert [call.what for call in calls(tmp_path)].count("connect") == 1


def test_a_driver_that_was_stopped_goes_on_to_hold_its_plant(start, halt, robot, tmp_path: Path) -> None:
    program = start("run", robot(duration=LONG), "--no-report")
    wait_for(lambda: "approach" in [call.what for call in calls(tmp_path)])
    os.kill(rig_processes(tmp_path)["driver"].pid, signal.SIGSTOP)
    assert halt().returncode == 0
    end_of(program)
    assert held_then_closed(tmp_path)


def test_a_driver_that_does_not_end_is_named(start, halt, robot, tmp_path: Path) -> None:
    program = start("run", robot(duration=LONG, advance="time.sleep(1e-3 if self.ticks < 20 else 6)"), "--no-report")
    wait_for(lambda: "approach" in [call.what for call in calls(tmp_path)])
    done = halt("--timeout", "0.5")
    end_of(program)
    assert done.returncode == 1
    assert "running  trial pd.noisy.0 of " in done.stderr
    assert "not held after 0.5 s: use the robot's own emergency stop" in done.stderr


def test_simulated_plants_end_too(start, halt, experiment, tmp_path: Path) -> None:
    program = start("run", experiment(duration=LONG), "--no-report")
    wait_for(under_way(tmp_path))
    assert halt().stdout.startswith("held     trial pd.noisy.0 of ")
    end_of(program)
    (outcome,) = (json.loads(path.read_text()) for path in (tmp_path / "runs").glob("*/trials/*/outcome.json"))
    assert outcome["reason"] == "halted by hilrig halt"


def test_where_no_rig_runs_it_says_so(halt) -> None:
    done = halt()
    assert (done.returncode, done.stdout) == (0, "no rig of yours is running on this machine\n")
