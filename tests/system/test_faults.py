"""Faults over the real bus: what the record shows is what was injected."""

from __future__ import annotations

import json
from pathlib import Path

from helpers.real_rig import only_run

from hilrig.recording.bag import read_bag
from hilrig.recording.fault_log import read_faults

FAULTS = """
  noisy:
    - {kind: stall, process: driver, duration: 3 ms, at: 0.1 s}
    - {kind: stall, process: driver, by: stop, duration: 3 ms, at: 0.2 s}
    - {kind: stall, process: controller, duration: 3 ms, at: 0.3 s}
    - {kind: stall, process: controller, by: stop, duration: 3 ms, at: 0.4 s}
    - {kind: slow_controller, duration: 3 ms, at: 0.5 s}
    - {kind: bus_delay, channel: state, duration: 3 ms, at: 0.6 s}
    - {kind: bus_delay, channel: command, duration: 3 ms, at: 0.7 s}
    - {kind: bus_loss, channel: state, at: 0.8 s}
    - {kind: bus_loss, channel: command, at: 0.9 s}
"""
KINDS = {
    100: "driver_stall", 200: "driver_stop", 300: "controller_stall", 400: "controller_stop", 500: "controller_busy",
    600: "state_delay", 700: "command_delay", 800: "state_loss", 900: "command_loss",
}  # fmt: skip


def test_every_fault_happens_at_its_tick_and_makes_ticks_late(hilrig, experiment, tmp_path: Path) -> None:
    file = experiment(clock="realtime", duration=1.0)
    text = file.read_text()
    begin = text.index("  noisy:")
    file.write_text(text[:begin] + FAULTS.strip("\n") + text[text.index("\ncontrollers:") :])
    done = hilrig("run", file, "--no-report")
    assert done.returncode == 0, done.stderr
    (trial,) = (only_run(tmp_path) / "trials").iterdir()
    faults = read_faults(trial)
    # In real time a process that the machine held up leaves ticks out, and what was to be done to it there is not done.
    assert len(faults) >= 5
    assert all(KINDS[fault.tick] == fault.kind for fault in faults)
    bag = read_bag(trial / "bag.mcap", ("driver_timing", "controller_timing"))
    driver, controller = bag["driver_timing"], bag["controller_timing"]
    published = dict(zip(driver["tick"].tolist(), driver["published"].tolist(), strict=True))
    applied = dict(zip(driver["tick"].tolist(), driver["applied"].tolist(), strict=True))
    acting = dict(zip(driver["tick"].tolist(), driver["command"].tolist(), strict=True))
    woke = dict(zip(driver["tick"].tolist(), driver["woke"].tolist(), strict=True))
    received = dict(zip(controller["tick"].tolist(), controller["received"].tolist(), strict=True))
    computed = dict(zip(controller["tick"].tolist(), controller["computed"].tolist(), strict=True))
    for tick, kind, begin, end in ((f.tick, f.kind, f.begin, f.end) for f in faults):
        assert kind.endswith("_loss") or end - begin >= 3_000_000
        if kind.startswith("driver"):
            assert woke[tick] <= begin <= end <= published[tick]
        elif kind in ("controller_stall", "controller_stop", "controller_busy"):
            assert received[tick] <= begin <= end <= computed[tick]
        elif kind == "state_delay":
            assert tick not in received or received[tick] - published[tick] >= 2_500_000
        elif kind == "state_loss":
            assert tick not in received
        # Late is a period whose command is older than it should be; a driver that stalls has it, but applies it late.
        # One that the machine held up applies it when the fault is over.
        after = next(done for done in sorted(applied) if done > tick)
        in_time = kind.endswith("_loss") or applied[after] < end
        assert kind.startswith("driver") or not in_time or acting[after] < after - 1, kind
    assert json.loads((trial / "timing.json").read_text())["late"] >= 10, "five stalls of 3 ms alone make more"


def test_faults_are_refused_in_one_process_and_in_lockstep(hilrig, experiment, tmp_path: Path) -> None:
    more = "conditions:\n  lossy: [{kind: bus_loss, channel: state, probability: 1 %}]"
    file = experiment(clock="realtime")
    text = file.read_text()
    begin = text.index("conditions:")
    file.write_text(text[:begin] + more + text[text.index("\ncontrollers:") :])
    done = hilrig("run", file, "--in-process")
    assert done.returncode == 2
    assert "--in-process: condition 'lossy' has the fault 'bus_loss'" in done.stderr
    assert not (tmp_path / "runs").exists()
    done = hilrig("check", file, "--set", "clock=lockstep")
    assert done.returncode == 2
    assert "'bus_loss' is a fault of the real-time loop: it needs the clock 'realtime', not 'lockstep'" in done.stderr


def test_a_trial_without_faults_has_no_log_of_them(hilrig, experiment, tmp_path: Path) -> None:
    assert hilrig("run", experiment(clock="realtime", duration=0.2), "--no-report").returncode == 0
    (trial,) = (only_run(tmp_path) / "trials").iterdir()
    assert not (trial / "faults.json").exists()
    assert json.loads((trial / "outcome.json").read_text())["outcome"] == "completed"
