"""Trials in one process: in blocks, everything is recorded once and only once, however the trial ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers.builders import trial

from hilrig.core.errors import Stopped
from hilrig.core.interfaces import Law, Task
from hilrig.core.signals import Array, Reference, State
from hilrig.experiment.trial import Limits, PhaseSpec, Trial
from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.disturbances.sensor_noise import SensorNoise
from hilrig.kinds.references.hold import Hold
from hilrig.loop.driver_node import DriverNode
from hilrig.loop.whole_trial import WholeTrial
from hilrig.recording.bag import read_bag
from hilrig.recording.recorder import Recorder
from hilrig.rig import in_process
from hilrig.rig.in_process import run_in_process

BLOCK = 37
FREE = Limits(joint_margin=None)
PER_TICK = ("state", "truth", "command", "internals")


class Memory(NamedTuple):
    table: Array
    count: Array


@dataclass(frozen=True)
class Faulty:
    """A law with a memory of several fields that raises `error` at the call `at`."""

    error: type[BaseException] | None = None
    at: int = 100

    def start(self, task: Task, state: State) -> Law:
        def step(parameters: object, memory: Memory, state: State, reference: Reference) -> Array:
            memory.count[0] += 1
            memory.table[:] += np.outer(state.position, state.velocity)
            if self.error is not None and memory.count[0] == self.at:
                raise self.error("no idea")
            force = 300.0 * (reference.position - state.position) - 20.0 * state.velocity + reference.force
            return state.jacobian.T @ force

        return Law(step, None, Memory(np.zeros((2, 2)), np.zeros(1)))


@pytest.fixture(autouse=True)
def _short_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(in_process, "BLOCK", BLOCK)
    monkeypatch.setattr(in_process, "PROGRESS_NS", 0)


def stopping(at: int) -> tuple[Callable[[int], None], Callable[[], bool]]:
    """Return `report` and `stop` of someone who wants an end at tick `at`, or at the first look after it."""
    heard = [0]
    return heard.append, lambda: heard[-1] >= at


def recorded(run: Path, subject: Trial) -> dict[str, dict[str, Array]]:
    return read_bag(run / "trials" / subject.id / "bag.mcap")


def assert_recorded_once(run: Path, subject: Trial, sensed: int, acted: int) -> None:
    """Check that there are so many ticks from 0 on, each once and in order."""
    bag = recorded(run, subject)
    for name in PER_TICK:
        count = sensed if name in ("state", "truth") else acted
        assert bag[name]["tick"].tolist() == list(range(count)), name


@pytest.mark.parametrize("ticks", [200, 2 * BLOCK + 1, 2, 1])
def test_blocks_record_what_single_ticks_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ticks: int) -> None:
    phase = PhaseSpec("press", 0.0, ticks * 1e-3, {"x": Hold(0.1)}, {"z": Hold(3.5)})
    noise = SensorNoise(force=0.05, joint=2e-5)
    subject = trial(
        controller=Faulty(), disturbances=(noise,), phases=(phase,), start_position=(0.1, 0.36), limits=FREE
    )
    fast = run_in_process(tmp_path / "fast", subject)
    monkeypatch.setattr(DriverNode, "compiled", False)
    slow = run_in_process(tmp_path / "slow", subject)
    one, other = recorded(tmp_path / "fast", subject), recorded(tmp_path / "slow", subject)
    assert (fast.outcome, fast.ticks) == (slow.outcome, slow.ticks) == ("completed", ticks)
    for name in PER_TICK:
        account = {"sent": ticks, "stored": ticks, "lost": 0, "gap_count": 0, "gaps": []}
        assert fast.channels[name] == slow.channels[name] == account
        assert one[name].keys() == other[name].keys()
        for field, values in one[name].items():
            np.testing.assert_array_equal(values.view(np.uint64), other[name][field].view(np.uint64), err_msg=field)
    assert "driver_timing" not in one, "no tick of a block has a time of its own"


@pytest.mark.parametrize("error", [RuntimeError, Stopped])
@pytest.mark.parametrize("at", [2, 50, BLOCK + 1, BLOCK + 2, 2 * BLOCK + 10])
def test_a_law_that_raises_within_a_block_leaves_what_was_done(
    tmp_path: Path, error: type[BaseException], at: int
) -> None:
    """Call `at` is that of tick at - 1, which was measured and has no command. A worker's signal raises Stopped so."""
    subject = trial(controller=Faulty(error, at))
    with pytest.raises(error, match="no idea"):
        run_in_process(tmp_path, subject)
    assert_recorded_once(tmp_path, subject, at, at - 1)


@pytest.mark.parametrize("at", [0, 1, 2, 50, 199])
def test_who_wants_an_end_gets_it_at_the_next_block(tmp_path: Path, at: int) -> None:
    subject = trial(controller=Pd())
    looks = (0, *range(1, 200, BLOCK))  # the first block is one tick: what it compiles is not waited for in silence
    came = next((look for look in looks if look >= at), None)
    outcome = run_in_process(tmp_path, subject, *stopping(at))
    if came is None:
        assert (outcome.outcome, outcome.ticks) == ("completed", 200)
    else:
        assert (outcome.outcome, outcome.reason, outcome.ticks) == ("aborted", "interrupted", came)
    if outcome.ticks:
        assert_recorded_once(tmp_path, subject, outcome.ticks, outcome.ticks)
    assert all(account["lost"] == 0 for account in outcome.channels.values())


def test_a_trip_within_a_block_leaves_what_was_done(tmp_path: Path) -> None:
    subject = trial(controller=Pd(), limits=Limits(joint_velocity=0.02), start_position=(0.1, 0.345))
    outcome = run_in_process(tmp_path, subject)
    assert outcome.outcome == "tripped"
    assert outcome.ticks > 1
    assert_recorded_once(tmp_path, subject, outcome.ticks, outcome.ticks)


@dataclass(frozen=True)
class NotFinite:
    """A law that never knows what to do."""

    def start(self, task: Task, state: State) -> Law:
        def step(parameters: object, memory: object, state: State, reference: Reference) -> Array:
            return np.full(2, np.nan)

        return Law(step, None, ())


def test_a_trip_at_the_first_tick_is_no_fault_of_the_warm_up(tmp_path: Path) -> None:
    """The state that tripped a limit is not recorded; one that the law made nothing of is."""
    pressed = trial(controller=Pd(), limits=Limits(tip_force=1.0), start_position=(0.1, 0.36))
    outcome = run_in_process(tmp_path / "limit", pressed)
    assert (outcome.outcome, outcome.ticks) == ("tripped", 0)
    assert outcome.reason == "tip force 8 N at t = 0 s (tick 0) is over the limit of 1 N"
    assert recorded(tmp_path / "limit", pressed) == {}
    lost = trial(controller=NotFinite())
    outcome = run_in_process(tmp_path / "law", lost)
    assert (outcome.outcome, outcome.ticks) == ("tripped", 0)
    assert outcome.reason == "tick 0: the torque of controller 'mine' is not finite: [nan nan]"
    assert {name: rows["tick"].tolist() for name, rows in recorded(tmp_path / "law", lost).items()} == {
        "state": [0], "truth": [0],
    }  # fmt: skip


def test_a_signal_between_two_blocks_records_no_block_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    do = WholeTrial.do

    def interrupted(self: WholeTrial, ticks: int, rows: Any) -> Any:
        if self.tick >= BLOCK:
            raise Stopped("terminated")
        return do(self, ticks, rows)

    subject = trial(controller=Pd())
    monkeypatch.setattr(WholeTrial, "do", interrupted)
    with pytest.raises(Stopped, match="terminated"):
        run_in_process(tmp_path, subject)
    assert_recorded_once(tmp_path, subject, BLOCK + 1, BLOCK + 1)


@pytest.mark.parametrize("at", [0, BLOCK, 5 * BLOCK])
def test_a_record_that_cannot_be_written_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at: int) -> None:
    """Also if someone wants an end before anybody has asked the thread."""
    store = Recorder.store

    def full(self: Recorder, name: str, payloads: Any) -> None:
        if payloads.shape[0] and int.from_bytes(payloads[0, 4:12].tobytes(), "little") >= at:
            raise OSError("no space left on device")
        store(self, name, payloads)

    subject = trial(controller=Pd())
    monkeypatch.setattr(Recorder, "store", full)
    with pytest.raises(OSError, match="no space left"):
        run_in_process(tmp_path, subject, *stopping(at + BLOCK))
