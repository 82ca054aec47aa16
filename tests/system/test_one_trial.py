"""One trial, three ways: over the bus, over the bus again, and in one process."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from helpers.real_rig import faulty, only_run

from hilrig.recording.bag import read_bag

CHANNELS = ("state", "truth", "command", "internals")


def bag_of(run: Path) -> dict[str, dict[str, np.ndarray]]:
    (trial,) = (run / "trials").iterdir()
    return read_bag(trial / "bag.mcap")


def run_once(hilrig, file: Path, out: Path, *options: str) -> Path:
    done = hilrig("run", file, "--no-report", "--out", out, *options)
    assert done.returncode == 0, done.stderr
    (run,) = out.iterdir()
    return run


@pytest.mark.parametrize("driver", ["two_link", pytest.param("pybullet_arm", marks=pytest.mark.needs_pybullet)])
def test_the_same_bits_on_the_bus_twice_and_in_one_process(hilrig, experiment, tmp_path: Path, driver: str) -> None:
    file = experiment(driver=driver, duration=0.4, controllers="proposed: {kind: tde_sliding_mode}")
    runs = [
        run_once(hilrig, file, tmp_path / "first"),
        run_once(hilrig, file, tmp_path / "second"),
        run_once(hilrig, file, tmp_path / "third", "--in-process"),
    ]
    first, second, third = map(bag_of, runs)
    for channel in CHANNELS:
        assert first[channel]["tick"].tolist() == list(range(400))
        for field, values in first[channel].items():
            np.testing.assert_array_equal(values.view(np.uint64), second[channel][field].view(np.uint64))
            np.testing.assert_array_equal(values.view(np.uint64), third[channel][field].view(np.uint64))


def test_every_message_is_accounted_for(hilrig, experiment, tmp_path: Path) -> None:
    run = run_once(hilrig, experiment(), tmp_path / "runs")
    outcome = json.loads(next((run / "trials").glob("*/outcome.json")).read_text())
    assert outcome["outcome"] == "completed"
    for channel in CHANNELS:
        account = outcome["channels"][channel]
        assert (account["sent"], account["stored"], account["lost"], account["gaps"]) == (500, 500, 0, [])
    assert all(account["lost"] == 0 for account in outcome["channels"].values())


def test_the_delay_of_the_command_is_what_the_experiment_says(hilrig, experiment, tmp_path: Path) -> None:
    """With torque actuation the torque in effect up to tick k is the command of tick k - 1 - delay."""
    for delay in (0, 2):
        run = run_once(hilrig, experiment(more=f"actuation_delay: {delay}"), tmp_path / f"delay{delay}")
        bag = bag_of(run)
        applied, commanded = bag["state"]["applied_torque"], bag["command"]["torque"]
        np.testing.assert_array_equal(applied[1 + delay :], commanded[: 500 - 1 - delay])
        assert (np.ptp(applied[: 1 + delay], axis=0) == 0).all()


@pytest.mark.parametrize("law", ["adaptive", "sliding_mode", "numpy"])
def test_the_same_bits_of_other_laws(hilrig, experiment, tmp_path: Path, law: str) -> None:
    """Compiled, and in plain NumPy."""
    laws = {"adaptive": "adaptive: {kind: adaptive}", "sliding_mode": "sliding_mode: {kind: sliding_mode}"}
    file = experiment(duration=0.2, controllers=laws.get(law) or faulty(tmp_path, "pass"))
    bus = bag_of(run_once(hilrig, file, tmp_path / "bus"))
    alone = bag_of(run_once(hilrig, file, tmp_path / "alone", "--in-process"))
    for channel in CHANNELS:
        assert bus[channel].keys() == alone[channel].keys()
        for field, values in bus[channel].items():
            np.testing.assert_array_equal(values.view(np.uint64), alone[channel][field].view(np.uint64), err_msg=field)


def slow_law(tmp_path: Path) -> str:
    """A law that sleeps 5 ms in every tenth call."""
    return faulty(tmp_path, "time.sleep(0.005)", when="memory.count[0] % 10 == 1")


def test_real_time_tells_the_ticks_whose_command_was_late(hilrig, experiment, tmp_path: Path) -> None:
    file = experiment(clock="realtime", duration=1.0, controllers=slow_law(tmp_path))
    run = run_once(hilrig, file, tmp_path / "runs")
    timing = json.loads(next((run / "trials").glob("*/timing.json")).read_text())
    bag = bag_of(run)
    assert timing["clock"] == "realtime"
    # A machine that is busy may hold the driver up for more than a period; then ticks are left out.
    assert timing["ticks"] == 1000 == len(bag["state"]["tick"]) + timing["missed"]
    assert bag["state"]["tick"][-1] == 999
    # Every sleep, but one cut off by the end, makes at least three ticks late.
    sleeps = np.count_nonzero(bag["internals"]["count"] % 10 == 1)
    stamps = bag["driver_timing"]
    late = stamps["command"] < stamps["tick"].astype(np.int64) - 1
    assert np.count_nonzero(late) >= 3 * (sleeps - 1) > 0
    # Stamps of a tick are in the order in which things happened; a command is of a measurement before it.
    for earlier, later in (("due", "woke"), ("woke", "applied"), ("applied", "published")):
        assert (stamps[earlier] <= stamps[later]).all()
    heard = stamps["command"] >= 0
    assert (stamps["received"][heard] <= stamps["applied"][heard]).all()
    assert (np.diff(stamps["command"]) >= 0).all()
    # What the controller skipped is a gap in its own channels, and none of it was lost on the way.
    outcome = json.loads(next((run / "trials").glob("*/outcome.json")).read_text())
    assert outcome["channels"]["command"]["gap_count"] > 0
    assert outcome["channels"]["command"]["lost"] == 0


def test_real_time_counts_the_ticks_whose_command_was_late(hilrig, experiment, tmp_path: Path) -> None:
    file = experiment(clock="realtime", duration=0.5, controllers=slow_law(tmp_path))
    run = run_once(hilrig, file, tmp_path / "runs")
    timing = json.loads(next((run / "trials").glob("*/timing.json")).read_text())
    stamps = bag_of(run)["driver_timing"]
    late = stamps["command"] < stamps["tick"].astype(np.int64) - 1
    overran = stamps["applied"] - stamps["due"] >= 1_000_000
    seen = np.count_nonzero((late & (stamps["tick"] > 0)) | overran)
    # A tick that the driver left out has no stamps; it is late too.
    assert timing["missed"] == 500 - len(stamps["tick"])
    assert timing["late"] - timing["missed"] == seen > 0


def test_a_trial_outside_its_budget_does_not_count(hilrig, experiment, tmp_path: Path) -> None:
    budget = "{late_fraction: 1 %, command_age_p99: 100 s}"
    done = hilrig("run", experiment(clock="realtime", controllers=slow_law(tmp_path), budget=budget), "--no-report")
    assert done.returncode == 1
    assert "outside its timing budget: late ticks" in done.stderr + done.stdout
    assert "at most 1 %" in done.stderr + done.stdout
    run = only_run(tmp_path)
    shown = hilrig("show", run)
    assert "invalid" in shown.stdout
    report = hilrig("report", run)
    assert report.returncode == 0, report.stderr
    assert "invalid" in next((tmp_path / "reports").glob("*/index.html")).read_text()
