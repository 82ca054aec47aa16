"""Trials without the bus, several at a time: the same bits as one after the other, and nothing takes the run down."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.patience import wait_for
from helpers.real_rig import LONG, end_of, faulty, only_run, rig_processes, under_way

from hilrig.recording.bag import read_bag

WORKERS = ("--no-report", "--in-process", "--jobs", "2")


def outcomes(run: Path) -> dict[str, dict[str, Any]]:
    found = [json.loads(path.read_text()) for path in run.glob("trials/*/outcome.json")]
    return {outcome["trial"]: outcome for outcome in found}


@pytest.fixture(autouse=True)
def _nothing_left(tmp_path: Path):
    yield
    wait_for(lambda: not rig_processes(tmp_path))


@pytest.mark.needs_pybullet
def test_the_same_bits_as_one_after_the_other(hilrig, experiment, tmp_path: Path) -> None:
    """The engine of the plant among them: PyBullet is not safe with threads."""
    file = experiment(
        driver="pybullet_arm", duration=0.3, controllers="pd: {kind: pd}\n  proposed: {kind: tde_sliding_mode}"
    )
    for out, jobs in (("one", "1"), ("two", "2")):
        done = hilrig("run", file, "--no-report", "--in-process", "--jobs", jobs, "--out", out)
        assert done.returncode == 0, done.stderr
    (one,), (two,) = ((tmp_path / out).iterdir() for out in ("one", "two"))
    trials = sorted(path.name for path in (one / "trials").iterdir())
    assert trials == ["pd.noisy.0", "proposed.noisy.0"]
    for trial in trials:
        first, second = (read_bag(run / "trials" / trial / "bag.mcap") for run in (one, two))
        for channel in ("state", "truth", "command", "internals"):
            assert first[channel]["tick"].tolist() == list(range(300))
            for field, values in first[channel].items():
                np.testing.assert_array_equal(values.view(np.uint64), second[channel][field].view(np.uint64))


@pytest.mark.parametrize(
    ("step", "outcome", "words"),
    [
        ("print('last words', flush=True); import os; os._exit(3)", "failed", "ended with exit code 3: last words"),
        ("raise RuntimeError('no idea')", "failed", "RuntimeError: no idea at faulty.py:"),
    ],
)
def test_a_worker_that_dies_fails_its_trial_alone(
    hilrig, experiment, tmp_path: Path, step: str, outcome: str, words: str
) -> None:
    controllers = faulty(tmp_path, step) + "\n  pd: {kind: pd}"
    done = hilrig("run", experiment(controllers=controllers), *WORKERS)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "(1 of 2 trials completed)" in done.stdout
    found = outcomes(only_run(tmp_path))
    assert {name: item["outcome"] for name, item in found.items()} == {
        "faulty.noisy.0": outcome, "pd.noisy.0": "completed",
    }  # fmt: skip
    assert words in found["faulty.noisy.0"]["reason"]


def test_fail_fast_begins_no_further_trial(hilrig, experiment, tmp_path: Path) -> None:
    controllers = faulty(tmp_path, "import os; os._exit(3)", when="True") + "\n  pd: {kind: pd}"
    done = hilrig("run", experiment(duration=4.0, controllers=controllers, more="repeats: 5"), *WORKERS, "--fail-fast")
    assert done.returncode == 1
    assert len(outcomes(only_run(tmp_path))) < 10


def test_ctrl_c_ends_the_trials_in_flight_cleanly(start, experiment, tmp_path: Path) -> None:
    controllers = "pd: {kind: pd}\n  softer: {kind: pd, stiffness: 500 N/m}"
    program = start("run", experiment(duration=LONG, controllers=controllers, more="repeats: 2"), *WORKERS)
    wait_for(under_way(tmp_path, trials=2))
    program.send_signal(signal.SIGINT)
    end_of(program)
    assert program.returncode == 130
    found = outcomes(only_run(tmp_path))
    assert sorted(found) == ["pd.noisy.0", "softer.noisy.0"]
    for name, outcome in found.items():
        assert (outcome["outcome"], outcome["reason"]) == ("aborted", "interrupted")
        assert all(account["lost"] == 0 for account in outcome["channels"].values())
        bag = read_bag(only_run(tmp_path) / "trials" / name / "bag.mcap")
        assert len(bag["state"]["tick"]) == outcome["ticks"] > 100


def test_a_hung_law_is_noticed_and_its_record_kept(hilrig, experiment, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("HILRIG_SILENCE_TIMEOUT", "5")  # longer than a loaded machine is silent
    controllers = faulty(tmp_path, "time.sleep(1000)") + "\n  pd: {kind: pd}"
    done = hilrig("run", experiment(controllers=controllers), *WORKERS)
    assert done.returncode == 1
    found = outcomes(only_run(tmp_path))
    assert found["pd.noisy.0"]["outcome"] == "completed"
    assert found["faulty.noisy.0"]["outcome"] == "timed_out"
    assert "no progress for 5 s after tick" in found["faulty.noisy.0"]["reason"]
    bag = read_bag(only_run(tmp_path) / "trials" / "faulty.noisy.0" / "bag.mcap")
    assert len(bag["command"]["tick"]) == 200


def test_a_killed_program_leaves_no_worker(start, experiment, tmp_path: Path) -> None:
    program = start("run", experiment(duration=LONG), *WORKERS)
    wait_for(under_way(tmp_path))
    os.kill(program.pid, signal.SIGKILL)
    wait_for(lambda: not rig_processes(tmp_path))
    bag = read_bag(next(only_run(tmp_path).glob("trials/*/bag.mcap")))
    assert len(bag["state"]["tick"]) > 100
