"""Messages that are not of the trial: each is refused and counted, none is applied, and the trial goes its way."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from helpers.intruder import Intruder
from helpers.real_rig import end_of, gate, gated, only_run

from hilrig.recording.bag import read_bag

FLOOD = 74_000


def refused(run: Path) -> dict[str, int]:
    """Return how many messages each channel of a run's only trial refused."""
    (timing,) = run.glob("trials/*/timing.json")
    return {channel: sum(reasons.values()) for channel, reasons in json.loads(timing.read_text())["refused"].items()}


def outcome(run: Path) -> str:
    (path,) = run.glob("trials/*/outcome.json")
    found = json.loads(path.read_text())
    return f"{found['outcome']} {found['reason']}".strip()


def signals(run: Path) -> dict[str, dict[str, np.ndarray]]:
    (bag,) = run.glob("trials/*/bag.mcap")
    return read_bag(bag, ("state", "truth", "command", "applied", "internals"))


def expected(intruder: Intruder) -> dict[str, int]:
    """Return what the receivers must count: an order reaches three of them."""
    return {name: number * (3 if name == "order" else 1) for name, number in intruder.sent.items()}


@pytest.mark.parametrize("flood", [0, FLOOD])
def test_in_lockstep_nothing_changes_by_a_bit(start, hilrig, experiment, tmp_path: Path, flood: int) -> None:
    file = experiment(duration=1.0, controllers=gated(tmp_path, "slow"))
    program = start("run", file, "--no-report")
    intruder = Intruder(tmp_path)
    kinds = intruder.send_all()
    intruder.flood(flood)
    intruder.leave()
    gate(tmp_path, "slow").touch()
    end_of(program)
    disturbed = only_run(tmp_path)
    assert kinds >= 60
    assert program.returncode == 0
    assert outcome(disturbed) == "completed"
    assert refused(disturbed) == expected(intruder)
    shutil.move(disturbed, tmp_path / "disturbed")
    assert hilrig("run", file, "--no-report").returncode == 0
    alone = only_run(tmp_path)
    assert refused(alone) == {}
    seen, wanted = signals(tmp_path / "disturbed"), signals(alone)
    assert seen.keys() == wanted.keys()
    for channel, fields in wanted.items():
        for name, values in fields.items():
            np.testing.assert_array_equal(seen[channel][name], values, f"{channel}.{name}")


def assert_only_commanded(run: Path) -> None:
    """Check that every torque in effect is one that the controller commanded, or the one that held the plant."""
    found = signals(run)
    in_effect = {tuple(torque) for torque in found["state"]["applied_torque"]}
    commanded = {tuple(torque) for torque in found["command"]["torque"]} | {tuple(found["state"]["applied_torque"][0])}
    assert in_effect <= commanded
    assert "applied" not in found


def test_in_real_time_the_trial_goes_its_way(start, experiment, tmp_path: Path) -> None:
    program = start("run", experiment(clock="realtime", duration=8.0), "--no-report")
    intruder = Intruder(tmp_path)
    intruder.send_all()
    intruder.leave()
    end_of(program)
    run = only_run(tmp_path)
    assert outcome(run) == "completed"
    assert refused(run) == expected(intruder)
    assert_only_commanded(run)


def test_a_flood_in_real_time_ends_in_hold_at_worst(start, experiment, tmp_path: Path) -> None:
    """It takes the processor's time. So commands may grow too old, and the watchdog ends the trial: it says so."""
    file = experiment(clock="realtime", duration=20.0, safety="safety: {command_age: 100 ms}")
    program = start("run", file, "--no-report", errors=tmp_path / "errors.txt")
    intruder = Intruder(tmp_path)
    intruder.flood(FLOOD)
    intruder.bus.close()
    end_of(program)
    run = only_run(tmp_path)
    told = outcome(run)
    assert told == "completed" or (told.startswith("tripped") and "safety.command_age" in told), told
    counted = refused(run)
    assert 0 < counted["command"] <= FLOOD
    assert 0 < counted["state"] <= FLOOD
    assert "Traceback" not in (tmp_path / "errors.txt").read_text()
    logs = {log.stem: log.read_text() for log in run.glob("trials/*/logs/*.log")}
    assert logs.keys() == {"driver", "controller", "logger"}
    assert not [role for role, text in logs.items() if "Traceback" in text]
    assert_only_commanded(run)
