from __future__ import annotations

from typing import Any

import pytest
from helpers.builders import trial

from hilrig.rig.outcome import Outcome, unexplained


def account(sent: int | None, stored: int) -> dict[str, Any]:
    return {"sent": sent, "stored": stored, "lost": None if sent is None else sent - stored, "gap_count": 0, "gaps": []}


WHOLE = {"state": account(200, 200), "command": account(200, 200)}


def test_a_complete_record_completes_the_trial() -> None:
    outcome = Outcome.of(trial(), "completed", "", 200, 0.1, WHOLE)
    assert outcome.completed
    assert outcome.speed == pytest.approx(2.0)
    assert outcome.document()["planned_ticks"] == 200
    assert outcome.document()["channels"] == WHOLE


@pytest.mark.parametrize(
    ("channels", "reason"),
    [
        ({"state": account(200, 200), "command": account(200, 198)}, "command: 198 stored, 200 sent"),
        ({"state": account(None, 200)}, "state: 200 stored, ? sent"),
        ({}, "the logger did not report what it stored"),
    ],
)
def test_a_record_with_missing_messages_fails_the_trial(channels: dict[str, Any], reason: str) -> None:
    outcome = Outcome.of(trial(), "completed", "", 200, 0.1, channels)
    assert outcome.outcome == "failed"
    assert reason in outcome.reason
    assert unexplained(channels) == outcome.reason


@pytest.mark.parametrize("end", ["tripped", "aborted", "timed_out", "failed"])
def test_missing_messages_do_not_change_an_earlier_reason(end: str) -> None:
    outcome = Outcome.of(trial(), end, "the reason", 10, 0.1, {"state": account(10, 9)})
    assert (outcome.outcome, outcome.reason) == (end, "the reason")
    assert not outcome.completed


def test_a_trial_that_never_ran_has_no_speed() -> None:
    assert Outcome.of(trial(), "timed_out", "not ready", 0, 0.0, {}).speed == 0.0
