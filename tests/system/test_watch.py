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
from helpers.real_rig import only_run, wait_for

from hilrig.recording.bag import read_bag

CHANNELS = ("state", "truth", "command", "internals")
TWO = "proposed: {kind: tde_sliding_mode}\n  pd: {kind: pd}"


def live(folder: Path) -> Any:
    """Return the live.json of the one run below `folder` if it names a trial."""
    for file in (folder / "runs").glob("*/live.json"):
        return json.loads(file.read_text())["trials"]
    return None


def assert_whole(run: Path, trials: int) -> None:
    """Check that every trial completed, and that its processes ended by themselves."""
    outcomes = [json.loads(file.read_text()) for file in run.glob("trials/*/outcome.json")]
    assert [item["outcome"] for item in outcomes] == ["completed"] * trials, outcomes
    for item in outcomes:
        assert all(account["lost"] == 0 for account in item["channels"].values())
    for log in run.glob("trials/*/logs/logger.log"):
        assert log.read_text() == ""


def test_a_watcher_follows_from_trial_to_trial_and_changes_no_bit(hilrig, start, experiment, tmp_path: Path) -> None:
    file = experiment(duration=60.0, controllers=TWO)
    hilrig("run", file, "--no-report", "--out", tmp_path / "alone")
    program = start("run", file, "--no-report")
    wait_for(lambda: live(tmp_path))
    watcher = start("watch")
    program.communicate(timeout=120)
    assert program.returncode == 0
    told, complaint = watcher.communicate(timeout=60)
    assert (watcher.returncode, complaint) == (0, "")
    assert "pd.noisy.0" in told
    assert "none late" in told
    watched, (alone,) = only_run(tmp_path), (tmp_path / "alone").iterdir()
    assert_whole(watched, 2)
    assert not (watched / "live.json").exists()
    for bag in alone.glob("trials/*/bag.mcap"):
        first, second = read_bag(bag), read_bag(watched / bag.relative_to(alone))
        for channel in CHANNELS:
            for field, values in first[channel].items():
                np.testing.assert_array_equal(values.view(np.uint64), second[channel][field].view(np.uint64))


@pytest.mark.parametrize("number", [signal.SIGSTOP, signal.SIGKILL])
def test_a_watcher_that_stands_still_or_dies_is_not_noticed(start, experiment, tmp_path: Path, number: int) -> None:
    program = start("run", experiment(clock="realtime", duration=8.0), "--no-report")
    wait_for(lambda: live(tmp_path))
    watcher = start("watch")
    assert watcher.stdout is not None
    first = watcher.stdout.readline()
    assert "pd.noisy.0" in first
    watcher.send_signal(number)
    _, complaint = program.communicate(timeout=120)
    assert program.returncode == 0, complaint
    assert_whole(only_run(tmp_path), 1)
    if number == signal.SIGSTOP:
        assert psutil.Process(watcher.pid).status() == psutil.STATUS_STOPPED
        watcher.send_signal(signal.SIGCONT)
        watcher.communicate(timeout=60)
        assert watcher.returncode == 0


def test_what_cannot_be_watched_is_said(hilrig, start, experiment, tmp_path: Path) -> None:
    nothing = hilrig("watch")
    assert (nothing.returncode, nothing.stdout) == (2, "")
    assert "no run below runs/ is going on" in nothing.stderr
    program = start("run", experiment(duration=600.0), "--no-report")
    wait_for(lambda: live(tmp_path))
    os.kill(program.pid, signal.SIGKILL)
    program.communicate(timeout=60)
    stale = hilrig("watch", only_run(tmp_path))
    assert stale.returncode == 2
    assert f"its program (process {program.pid}) was killed" in stale.stderr
    both = hilrig("run", experiment(), "--watch", "--in-process")
    assert both.returncode == 2
    assert "--watch needs the bus" in both.stderr


def test_run_with_a_watcher_keeps_results_apart(hilrig, experiment, tmp_path: Path) -> None:
    done = hilrig("run", experiment(clock="realtime", duration=8.0), "--no-report", "--watch")
    assert done.returncode == 0, done.stderr
    assert "[1/1] pd.noisy.0" in done.stderr
    assert "[1/1]" not in done.stdout
    assert "(1 of 1 trials completed)" in done.stdout
    assert_whole(only_run(tmp_path), 1)
