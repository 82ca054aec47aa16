"""`hilrig watch` beside real trials: it follows them, and whatever becomes of it, they do not notice."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from helpers.patience import wait_for
from helpers.real_rig import LONG, end_of, gate, gated, only_run, recorded

from hilrig.recording.bag import read_bag

CHANNELS = ("state", "truth", "command", "internals")
GATED = 6.0
"""s of a gated trial, which takes all the tests' patience before it comes to its end"""
SECONDS = 1_000_000
"""Bytes of a record: some seconds of it"""


def live(folder: Path) -> Any:
    """Return the live.json of the one run below `folder` if it names a trial."""
    for file in (folder / "runs").glob("*/live.json"):
        return json.loads(file.read_text())["trials"]
    return None


def assert_whole(run: Path, trials: int, ending: str = "completed") -> None:
    """Check that every trial ended so with nothing lost, and that its logger had nothing to complain of."""
    outcomes = [json.loads(file.read_text()) for file in run.glob("trials/*/outcome.json")]
    assert [item["outcome"] for item in outcomes] == [ending] * trials, outcomes
    for item in outcomes:
        assert all(account["lost"] == 0 for account in item["channels"].values())
    for log in run.glob("trials/*/logs/logger.log"):
        assert log.read_text() == ""


def test_a_watcher_follows_from_trial_to_trial_and_changes_no_bit(hilrig, start, experiment, tmp_path: Path) -> None:
    """Two trials crawl until the watcher has been seen in them; the third is a compiled law at full speed."""
    names, told = ("first", "second"), tmp_path / "told"
    laws = "\n  ".join([*(gated(tmp_path, name) for name in names), "proposed: {kind: tde_sliding_mode}"])
    file = experiment(duration=GATED, controllers=laws)
    for name in names:
        gate(tmp_path, name).touch()
    assert hilrig("run", file, "--no-report", "--out", tmp_path / "alone").returncode == 0
    for name in names:
        gate(tmp_path, name).unlink()
    program = start("run", file, "--no-report")
    wait_for(lambda: live(tmp_path))
    watcher = start("watch", output=told)
    for name in names:
        wait_for(lambda name=name: f"{name}.noisy.0" in told.read_text())
        gate(tmp_path, name).touch()
    end_of(program)
    assert program.returncode == 0
    _, complaint = end_of(watcher)
    assert (watcher.returncode, complaint) == (0, "")
    assert "none late" in told.read_text()
    watched, (alone,) = only_run(tmp_path), (tmp_path / "alone").iterdir()
    assert_whole(watched, 3)
    assert not (watched / "live.json").exists()
    for bag in alone.glob("trials/*/bag.mcap"):
        first, second = read_bag(bag), read_bag(watched / bag.relative_to(alone))
        for channel in CHANNELS:
            for field, values in first[channel].items():
                np.testing.assert_array_equal(values.view(np.uint64), second[channel][field].view(np.uint64))


@pytest.mark.parametrize("number", [signal.SIGSTOP, signal.SIGKILL])
def test_a_watcher_that_stands_still_or_dies_is_not_noticed(start, experiment, tmp_path: Path, number: int) -> None:
    """The trial in real time goes on, loses nothing, and ends when it is told to."""
    told = tmp_path / "told"
    program = start("run", experiment(clock="realtime", duration=LONG), "--no-report")
    wait_for(lambda: live(tmp_path))
    watcher = start("watch", output=told)
    wait_for(lambda: "pd.noisy.0" in told.read_text())
    watcher.send_signal(number)
    (there,) = recorded(tmp_path)
    wait_for(lambda: recorded(tmp_path)[0] > there + SECONDS)
    program.send_signal(signal.SIGINT)
    _, complaint = end_of(program)
    assert program.returncode == 130, complaint
    assert_whole(only_run(tmp_path), 1, "aborted")
    if number == signal.SIGSTOP:
        assert psutil.Process(watcher.pid).status() == psutil.STATUS_STOPPED
        watcher.send_signal(signal.SIGCONT)
        end_of(watcher)
        assert watcher.returncode == 0


def test_what_cannot_be_watched_is_said(hilrig, start, experiment, tmp_path: Path) -> None:
    nothing = hilrig("watch")
    assert (nothing.returncode, nothing.stdout) == (2, "")
    assert "no run below runs/ is running" in nothing.stderr
    program = start("run", experiment(duration=600.0), "--no-report")
    wait_for(lambda: live(tmp_path))
    os.kill(program.pid, signal.SIGKILL)
    end_of(program)
    stale = hilrig("watch", only_run(tmp_path))
    assert stale.returncode == 2
    assert f"its program (process {program.pid}) was killed" in stale.stderr
    both = hilrig("run", experiment(), "--watch", "--in-process")
    assert both.returncode == 2
    assert "--watch needs the bus" in both.stderr


def test_run_with_a_watcher_keeps_results_apart(start, experiment, tmp_path: Path) -> None:
    """The trial crawls until the watcher has been seen."""
    file, shown = experiment(duration=GATED, controllers=gated(tmp_path, "first")), tmp_path / "shown"
    program = start("run", file, "--no-report", "--watch", errors=shown)
    wait_for(lambda: "[1/1] first.noisy.0" in shown.read_text())
    gate(tmp_path, "first").touch()
    results, _ = end_of(program)
    assert program.returncode == 0
    assert "[1/1]" not in results
    assert "(1 of 1 trials completed)" in results
    assert_whole(only_run(tmp_path), 1)
