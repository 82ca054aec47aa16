"""The stall benchmark: which faults it injects, and how it counts what was found."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.stall_matching import compare
from benchmarks.stall_plan import CAUSES, DISTANCE, MARGIN, ROOM, dealt, experiment
from benchmarks.stalls import render
from hilrig.core.signals import Faults
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.experiment.trial import disturbance_schedule
from hilrig.recording.fault_log import InjectedFault


def fault(tick: int, kind: str, ms: float = 1.0) -> InjectedFault:
    return InjectedFault(tick, "driver", kind, 10**9, 10**9 + int(ms * 1e6))


@pytest.mark.parametrize("count", [1, 20, 1000])
def test_faults_are_dealt_apart_and_every_kind_as_often(count: int) -> None:
    ticks = dealt(count, seed=5)
    together = np.sort(np.concatenate(list(ticks.values())))
    assert together.size == count
    assert (np.diff(together) >= DISTANCE).all()
    assert MARGIN <= together[0] <= together[-1] < MARGIN + count * ROOM
    sizes = [len(found) for found in ticks.values()]
    assert max(sizes) - min(sizes) <= 1


def test_there_is_a_kind_and_a_cause_for_every_field_of_the_faults() -> None:
    assert set(CAUSES) == set(Faults._fields)
    assert {CAUSES[kind] for kind in ("driver_stall", "driver_stop")} == {"driver"}
    assert {CAUSES[kind] for kind in ("controller_stall", "controller_stop", "controller_busy")} == {"controller"}
    assert {kind for kind, cause in CAUSES.items() if cause == "transport"} == {
        "state_delay", "command_delay", "state_loss", "command_loss",
    }  # fmt: skip


def test_the_experiment_injects_what_was_dealt(tmp_path: Path) -> None:
    file = tmp_path / "stalls.yaml"
    file.write_text(json.dumps(experiment(60, seed=5)))
    quiet, faulty = plan(load(file))
    faults, none = disturbance_schedule(faulty).faults, disturbance_schedule(quiet).faults
    for kind, ticks in dealt(60, seed=5).items():
        values = getattr(faults, kind)
        assert np.flatnonzero(values).tolist() == ticks
        assert not getattr(none, kind).any()
        if not kind.endswith("_loss"):
            assert values[ticks].min() >= 1e-3
            assert values[ticks].max() <= 5e-3


def test_a_stall_in_the_reach_of_a_fault_is_its_detection_and_any_other_unexplained() -> None:
    injected = [
        fault(100, "driver_stall"), fault(200, "controller_busy", 3.0),
        fault(300, "state_loss", 0.0), fault(400, "command_delay"),
    ]  # fmt: skip
    found = [
        (99, "driver"), (100, "driver"), (101, "transport"), (104, "driver"), (105, "unknown"),
        (201, "transport"), (206, "controller"), (207, "driver"), (301, "transport"),
    ]  # fmt: skip
    judged = compare(injected, found, period=1e-3, delay=1)
    assert (judged["injected"], judged["detected"], judged["rightly_attributed"]) == (4, 3, 2)
    assert judged["confusion"] == {
        "driver_stall": {"driver": 1}, "controller_busy": {"transport": 1},
        "state_loss": {"transport": 1}, "command_delay": {"missed": 1},
    }  # fmt: skip
    assert [missed["tick"] for missed in judged["missed"]] == [400]
    assert judged["unexplained"] == [[99, "driver"], [105, "unknown"], [207, "driver"]]


def test_the_result_is_told_in_figures_and_a_table() -> None:
    judged = compare(
        [fault(100, "driver_stall"), fault(200, "state_loss")], [(100, "driver"), (150, "unknown")], 1e-3, 1
    )
    text = render({"planned": 3, **judged, "own_stalls": [], "ticks": 500})
    assert "2 of 3 planned faults injected into 500 ticks" in text
    assert "detected            1 of 2 (50.0 %)" in text
    assert "were not injected: 1; in as many ticks without faults, just before: 0" in text
    (row,) = [line for line in text.splitlines() if line.startswith("state_loss")]
    assert row.split() == ["state_loss", "transport", "|", "0", "0", "0", "0", "1"]
