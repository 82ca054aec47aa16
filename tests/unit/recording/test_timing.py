"""timing.json: what it says of a trial, from the stamps of a loop that was simulated."""

from __future__ import annotations

import json

import numpy as np
import pytest
from helpers.builders import trial
from helpers.loop_simulation import MS, Loop, Stall

from hilrig.experiment.timing_budget import TimingBudget
from hilrig.experiment.trial import Trial
from hilrig.recording.certificate.durations import Terms
from hilrig.recording.certificate.table import StampColumns
from hilrig.recording.timing import DURATIONS, certify, terms_of

TERMS, BUDGET = Terms("realtime", 1e-3, 1), TimingBudget()


def channels(*stalls: Stall, ticks: int = 200) -> dict[str, StampColumns]:
    return dict(zip(("driver_timing", "controller_timing"), Loop(list(stalls), ticks).run().columns(), strict=True))


def test_a_good_trial_is_valid() -> None:
    timing = certify(TERMS, BUDGET, channels())
    assert (timing["clock"], timing["ticks"], timing["late"], timing["late_fraction"]) == ("realtime", 200, 0, 0.0)
    assert (timing["valid"], timing["invalid_because"], timing["one_clock"]) == (True, [], True)
    assert timing["budget"] == {"late_fraction": 0.005, "command_age_p99": 1.25e-3}
    assert timing["compute_us"]["p50"] == pytest.approx(120, rel=0.1)
    assert timing["command_age_us"]["p50"] == pytest.approx(1035, rel=0.01)
    assert json.loads(json.dumps(timing)) == timing, "plain data"


def test_a_late_trial_says_through_whom_and_why_it_is_invalid() -> None:
    timing = certify(
        TERMS, BUDGET, channels(Stall("controller_compute", 50, int(2.4 * MS)), Stall("state_loss", 90, 0))
    )
    assert timing["late_by"] == {"driver": 0, "transport": 1, "controller": 2, "unknown": 0}
    assert (timing["late"], timing["late_fraction"], timing["valid"]) == (3, 0.015, False)
    assert timing["invalid_because"][0] == "late ticks 1.5 %, at most 0.5 %"


def test_every_histogram_counts_every_value() -> None:
    stamps = channels()
    timing = certify(TERMS, BUDGET, stamps)
    assert set(timing["histograms"]) == set(DURATIONS)
    lateness = np.sort(stamps["driver_timing"]["woke"] - stamps["driver_timing"]["due"])
    bins = timing["histograms"]["lateness"]
    spread = np.concatenate([np.full(count, edge) for edge, count in bins])
    assert spread.size == 200
    assert np.all(spread <= lateness)
    assert np.all(lateness <= spread * (1 + 1 / 64) + 1)


def test_lockstep_has_nothing_to_keep() -> None:
    timing = certify(TERMS._replace(clock="lockstep"), BUDGET, channels(Stall("driver_publish", 50, 9 * MS)))
    assert (timing["late"], timing["valid"], timing["invalid_because"], timing["lateness_us"]) == (0, None, [], None)
    assert "lateness" not in timing["histograms"]


@pytest.mark.parametrize(("clock", "valid"), [("lockstep", None), ("realtime", False)])
def test_no_stamp_proves_nothing(clock: str, valid: bool | None) -> None:
    timing = certify(TERMS._replace(clock=clock), BUDGET, {})
    assert (timing["ticks"], timing["late"], timing["valid"], timing["histograms"]) == (0, 0, valid, {})
    assert all(timing[f"{name}_us"] is None for name in DURATIONS)


def test_the_set_up_is_kept() -> None:
    setup = {"driver": {"memory_locked": {"wanted": True, "applied": False, "reason": "not permitted"}}}
    assert certify(TERMS, BUDGET, channels(), setup)["setup"] == setup


def test_a_trials_document_keeps_its_budget() -> None:
    some = trial(clock="realtime", actuation_delay=2, timing=TimingBudget(0.01))
    again = Trial.from_document(json.loads(json.dumps(some.to_document())))
    assert again.timing == some.timing
    assert terms_of(some.to_document()) == Terms("realtime", 1e-3, 2)
    assert certify(terms_of(again.to_document()), again.timing, {})["budget"] == {
        "late_fraction": 0.01, "command_age_p99": pytest.approx(2.25e-3),
    }  # fmt: skip


def test_a_limit_that_the_experiment_gives_takes_the_place_of_the_default() -> None:
    assert certify(TERMS, TimingBudget(command_age_p99=3e-3), {})["budget"]["command_age_p99"] == 3e-3
