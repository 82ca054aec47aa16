"""The benchmark as a user runs it, with tiny counts. What the figures are is not looked at."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from benchmarks.exchange import TRANSPORTS, Sizes, Transport, round_trips
from benchmarks.placement import placement
from hilrig.core.errors import RigError

Hilrig = Callable[..., CompletedProcess[str]]
BARE, SOCKETS = TRANSPORTS[:2]
KEYS = {"form", "started", "wall_s", "settings", "machine", "warnings", "payload_bytes", "measurands", "comparisons"}


def test_a_part_is_measured_printed_and_shown_again(hilrig: Hilrig, tmp_path: Path) -> None:
    chosen = ("--only", "zenoh.back_to_back", "--only", "unix_datagram.paced")
    done = hilrig("bench", "--quick", *chosen, "--json", "--out", "found.json", timeout=300.0)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found.keys() == KEYS
    assert list(found["measurands"]) == ["zenoh.back_to_back", "unix_datagram.paced"]
    for item in found["measurands"].values():
        assert item["note"] == ""
        assert len(item["quantities"]["round_trip_p50_us"]["values"]) == 1
    assert "[1/1] [2/2] unix_datagram.paced" in done.stderr

    again = hilrig("bench", "--from", "found.json", "--markdown", "page.md")
    assert again.returncode == 0, again.stderr
    assert "zenoh, bare" in again.stdout
    assert "zenoh, bare" in (tmp_path / "page.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "lockstpe"), "--only: there is no 'lockstpe'; did you mean 'lockstep'?"),
        (("--repeats", "0"), "--repeats: 0 repeats; 1 is the least"),
        (("--out", "nowhere/x.json"), "nowhere/x.json: there is no folder"),
        (("--from", "other.json"), "other.json: not what 'hilrig bench --out' of this version writes"),
    ],
)
def test_a_wrong_call_says_what_is_wrong(
    hilrig: Hilrig, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    (tmp_path / "other.json").write_text("{}")
    done = hilrig("bench", *arguments)
    assert done.returncode == 2
    assert message in done.stderr


@pytest.mark.parametrize("transport", [BARE, SOCKETS], ids=lambda transport: transport.name)
def test_a_pair_makes_its_round_trips(transport: Transport) -> None:
    paced = round_trips(transport, Sizes(100, 68), placement(False, False), 20, 1e-3)
    assert 0 < paced["round_trip_p50_us"] <= paced["round_trip_p99_us"] <= paced["round_trip_max_us"]


def test_a_pair_that_fails_says_why() -> None:
    with pytest.raises(RigError, match="exit code 1: KeyError: 'none'"):
        round_trips(BARE, Sizes(100, 68), placement(False, False)._replace(policy="none"), 20, 0.0)
