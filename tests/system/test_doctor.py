"""hilrig doctor on this machine, whatever it is."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable

Program = Callable[..., subprocess.CompletedProcess[str]]


def test_the_machine_is_examined_probed_and_judged(hilrig: Program) -> None:
    done = hilrig("doctor", "--seconds", "0.3", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["verdict"]["word"] in ("ready", "usable with late ticks", "not ready")
    assert bool(told["verdict"]["because"]) == (told["verdict"]["word"] != "ready")
    probe = told["probe"]
    assert (probe["ticks"], probe["period"]) == (300, 1e-3)
    assert 0 <= probe["lateness_us"]["p50"] <= probe["lateness_us"]["p99"] <= probe["lateness_us"]["max"]
    assert 0 < probe["round_trip_us"]["p50"] <= probe["round_trip_us"]["max"]
    assert probe["unanswered"] < 300
    assert set(probe["setup"]) == {"driver", "controller"}
    assert {item["verdict"] for item in told["findings"]} <= {"ok", "note", "fault"}
    assert told["host"]["release"]


def test_a_person_is_shown_a_table_and_the_commands(hilrig: Program) -> None:
    done = hilrig("doctor", "--seconds", "0.1")
    assert done.returncode == 0, done.stderr
    assert done.stderr == "measuring for 0.1 s ...\n"
    for part in ("SCHED_FIFO", "round trip over the bus", "late ticks", "1 ms on this machine: "):
        assert part in done.stdout
