"""Processes that die, hang, raise or trip: the outcome says so, the bag is readable, nothing is left behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from helpers.patience import wait_for
from helpers.real_rig import LONG, end_of, faulty, only_run, rig_processes, socket_directories, under_way

from hilrig.recording.bag import read_bag


def outcome_of(run: Path) -> dict[str, Any]:
    return json.loads(next((run / "trials").glob("*/outcome.json")).read_text())


@pytest.fixture(autouse=True)
def _nothing_left(tmp_path: Path):
    before = socket_directories()
    yield
    wait_for(lambda: not rig_processes(tmp_path))
    wait_for(lambda: socket_directories() <= before)


@pytest.mark.parametrize("role", ["controller", "driver", "logger"])
def test_a_killed_process_fails_the_trial(start, experiment, tmp_path: Path, role: str) -> None:
    program = start("run", experiment(duration=LONG), "--no-report")
    wait_for(under_way(tmp_path))
    rig_processes(tmp_path)[role].kill()
    _, stderr = end_of(program)
    assert program.returncode == 1
    outcome = outcome_of(only_run(tmp_path))
    assert outcome["outcome"] == "failed"
    assert f"the {role} process was killed by SIGKILL" in outcome["reason"]
    assert outcome["reason"] in stderr.replace("\n", "")
    bag = read_bag(next(only_run(tmp_path).glob("trials/*/bag.mcap")))
    assert len(bag["state"]["tick"]) > 100


def test_ctrl_c_ends_the_trial_in_flight_cleanly(start, experiment, tmp_path: Path) -> None:
    program = start("run", experiment(duration=LONG), "--no-report")
    wait_for(under_way(tmp_path))
    program.send_signal(signal.SIGINT)
    end_of(program)
    assert program.returncode == 130
    outcome = outcome_of(only_run(tmp_path))
    assert outcome["outcome"] == "aborted"
    assert all(account["lost"] == 0 for account in outcome["channels"].values())
    bag = read_bag(next(only_run(tmp_path).glob("trials/*/bag.mcap")))
    assert len(bag["state"]["tick"]) == outcome["ticks"] > 100


def test_ctrl_c_before_the_trial_has_begun(start, experiment, tmp_path: Path) -> None:
    program = start("run", experiment(duration=LONG), "--no-report")
    wait_for(lambda: len(rig_processes(tmp_path)) == 3)
    program.send_signal(signal.SIGINT)
    end_of(program)
    assert program.returncode == 130
    assert outcome_of(only_run(tmp_path))["outcome"] == "aborted"


def test_a_killed_supervisor_leaves_no_process(start, experiment, tmp_path: Path) -> None:
    program = start("run", experiment(duration=LONG), "--no-report")
    wait_for(under_way(tmp_path))
    os.kill(program.pid, signal.SIGKILL)
    wait_for(lambda: not rig_processes(tmp_path))
    bag = read_bag(next(only_run(tmp_path).glob("trials/*/bag.mcap")))
    assert len(bag["state"]["tick"]) > 100


def test_a_supervisor_killed_at_the_start_leaves_nothing(start, experiment, tmp_path: Path) -> None:
    program = start("run", experiment(duration=LONG), "--no-report")
    wait_for(lambda: len(rig_processes(tmp_path)) == 3)
    os.kill(program.pid, signal.SIGKILL)
    wait_for(lambda: not rig_processes(tmp_path))


def test_a_stopped_controller_is_noticed(start, experiment, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("HILRIG_SILENCE_TIMEOUT", "5")  # longer than a loaded machine is silent
    program = start("run", experiment(duration=LONG), "--no-report")
    wait_for(under_way(tmp_path))
    rig_processes(tmp_path)["controller"].send_signal(signal.SIGSTOP)
    end_of(program)
    assert program.returncode == 1
    outcome = outcome_of(only_run(tmp_path))
    assert outcome["outcome"] == "timed_out"
    assert "no progress for 5 s" in outcome["reason"]


@pytest.mark.parametrize(
    ("step", "outcome", "words"),
    [
        ("raise RuntimeError('no idea')", "failed", "controller: RuntimeError: no idea at faulty.py:"),
        ("raise SystemExit(0)", "failed", "controller: sys.exit(0) was called at faulty.py:"),
        (
            "return torque[:1]",
            "failed",
            "controller 'faulty': step returned an array of shape (1,); the robot needs one of shape (2,)",
        ),
        (
            "return None",
            "failed",
            "controller 'faulty': step returned None; it must be an array of real numbers",
        ),
        ("return torque * np.nan", "tripped", "the torque of controller 'faulty' is not finite"),
        ("return torque + [100.0, 0.0]", "tripped", "over the limit of"),
    ],
)
def test_a_faulty_law(hilrig, experiment, tmp_path: Path, step: str, outcome: str, words: str) -> None:
    controllers = faulty(tmp_path, step)
    done = hilrig("run", experiment(duration=5.0, controllers=controllers), "--no-report")
    assert done.returncode == 1
    result = outcome_of(only_run(tmp_path))
    assert result["outcome"] == outcome
    assert words in result["reason"]
    assert "Traceback" not in done.stderr
    bag = read_bag(next(only_run(tmp_path).glob("trials/*/bag.mcap")))
    assert len(bag["command"]["tick"]) >= 200


def test_a_process_that_never_gets_ready_is_named(hilrig, experiment, tmp_path: Path, monkeypatch) -> None:
    """The plan starts the law once in the program itself, so the fault must wait for the controller's process.

    On a loaded machine the others may not be ready in time either.
    """
    monkeypatch.setenv("HILRIG_READY_TIMEOUT", "6")
    stuck = "time.sleep(1000 if 'controller_process' in str(__import__('sys').orig_argv) else 0)"
    controllers = faulty(tmp_path, "pass", start=stuck)
    done = hilrig("run", experiment(controllers=controllers), "--no-report")
    assert done.returncode == 1
    result = outcome_of(only_run(tmp_path))
    assert result["outcome"] == "timed_out"
    head, _, names = result["reason"].partition(": ")
    assert head == "not ready after 6 s"
    assert "controller" in names.split(", ")


def test_fail_fast_begins_no_further_trial(hilrig, experiment, tmp_path: Path) -> None:
    controllers = faulty(tmp_path, "raise RuntimeError('no')") + "\n  pd: {kind: pd}"
    done: subprocess.CompletedProcess[str] = hilrig(
        "run", experiment(controllers=controllers), "--no-report", "--in-process", "--fail-fast"
    )
    assert done.returncode == 1
    assert len(list(only_run(tmp_path).glob("trials/*"))) == 1
    assert outcome_of(only_run(tmp_path))["reason"].startswith("RuntimeError: no at faulty.py:")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("step", ["raise RuntimeError('[no]')", "raise SystemExit(0)"])
def test_a_law_that_raises_in_one_process_does_not_end_the_others(
    hilrig, experiment, tmp_path: Path, step: str
) -> None:
    controllers = faulty(tmp_path, step) + "\n  pd: {kind: pd}"
    assert hilrig("run", experiment(controllers=controllers), "--no-report", "--in-process").returncode == 1
    shown = hilrig("show", only_run(tmp_path)).stdout
    assert "faulty.noisy.0  failed" in shown
    assert "pd.noisy.0      completed" in shown


@pytest.mark.parametrize("how", [(), ("--in-process",), ("--in-process", "--jobs", "2")], ids=" ".join)
def test_what_is_no_exception_ends_its_own_trial_only(hilrig, experiment, tmp_path: Path, how: tuple[str, ...]) -> None:
    """asyncio's CancelledError is a BaseException, and no Exception."""
    controllers = faulty(tmp_path, "import asyncio; raise asyncio.CancelledError('enough')") + "\n  pd: {kind: pd}"
    done = hilrig("run", experiment(controllers=controllers), "--no-report", *how)
    assert done.returncode == 1
    ended = {
        path.parent.name: json.loads(path.read_text()) for path in only_run(tmp_path).glob("trials/*/outcome.json")
    }
    assert [ended[name]["outcome"] for name in sorted(ended)] == ["failed", "completed"]
    assert "CancelledError: enough at faulty.py:" in ended[min(ended)]["reason"]


def test_a_thread_that_a_law_leaves_does_not_keep_the_program(hilrig, experiment, tmp_path: Path) -> None:
    leave = "import threading; threading.Thread(target=time.sleep, args=(1e4,), name='left').start()"
    controllers = faulty(tmp_path, leave, when="memory.count[0] == 3")
    done = hilrig("run", experiment(controllers=controllers), "--no-report", "--in-process")
    assert done.returncode == 0
    assert "1 of 1 trials completed" in done.stdout


def endings(under: Path) -> dict[str, dict[str, Any]]:
    return {path.parent.name: json.loads(path.read_text()) for path in only_run(under).glob("trials/*/outcome.json")}


@pytest.mark.parametrize("how", [(), ("--in-process",)], ids=" ".join)
def test_a_law_that_asks_for_memory_without_end_fails_its_own_trial(
    hilrig, experiment, tmp_path: Path, how: tuple[str, ...]
) -> None:
    """Its outcome says how much a law may take, and where this one asked for more."""
    law = faulty(tmp_path, "globals().setdefault('kept', []).append(np.ones(1_000_000))", when="True")
    file = experiment(duration=2.0, controllers=law + "\n  pd: {kind: pd}")
    assert hilrig("run", file, "--no-report", "--set", "rig.law_memory=0.5 GB", *how).returncode == 1
    ended = endings(tmp_path)
    assert {name: found["outcome"] for name, found in ended.items()} == {
        "faulty.noisy.0": "failed", "pd.noisy.0": "completed",
    }  # fmt: skip
    reason = ended["faulty.noisy.0"]["reason"]
    assert "out of memory: a law may take 0.5 GB (rig.law_memory): " in reason
    assert "MemoryError" in reason
    assert "faulty.py:" in reason


SPINNING = '''
from dataclasses import dataclass
from typing import NamedTuple
import numpy as np
from hilrig import Law, kernel

class Memory(NamedTuple):
    count: np.ndarray

@kernel
def step(parameters, memory, state, reference):
    memory.count[0] += 1.0
    while memory.count[0] > 200.0:
        memory.count[0] += 1.0
    return 0.0 * state.torque

@dataclass(frozen=True)
class Spinning:
    """Never returns from its 201st call."""

    def start(self, task, state):
        return Law(step, (), Memory(np.zeros(1)))
'''


@pytest.mark.parametrize("how", [(), ("--in-process",), ("--in-process", "--jobs", "2")], ids=" ".join)
def test_a_law_that_hangs_in_compiled_code_ends_its_own_trial(
    hilrig, experiment, tmp_path: Path, monkeypatch, how: tuple[str, ...]
) -> None:
    """No signal handler of Python runs there."""
    monkeypatch.setenv("HILRIG_SILENCE_TIMEOUT", "5")
    (tmp_path / "spinning.py").write_text(SPINNING)
    controllers = "spinning: {kind: ./spinning.py}\n  pd: {kind: pd}"
    assert hilrig("run", experiment(controllers=controllers), "--no-report", *how).returncode == 1
    assert {name: found["outcome"] for name, found in endings(tmp_path).items()} == {
        "spinning.noisy.0": "timed_out", "pd.noisy.0": "completed",
    }  # fmt: skip
