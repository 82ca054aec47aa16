"""The benchmarks as they are run from a checkout, with tiny counts. The figures themselves are not checked."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from helpers.real_rig import PROJECT, only_run

from benchmarks.alternation import RIG, certificate_cost
from benchmarks.exchange import TRANSPORTS, Sizes, Transport, round_trips
from benchmarks.placement import placement
from benchmarks.trials import TrialCall
from hilrig.core.errors import RigError

Program = Callable[..., CompletedProcess[str]]
BARE, SOCKETS = TRANSPORTS[:2]
KEYS = {"form", "started", "wall_s", "settings", "machine", "warnings", "payload_bytes", "measurands", "comparisons"}


@pytest.fixture
def benchmarks(tmp_path: Path) -> Program:
    """Run `python -m benchmarks` from the checkout, and return what it did."""

    def call(*arguments: str | Path, timeout: float = 120.0) -> CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "benchmarks", *map(str, arguments)],
            cwd=PROJECT, capture_output=True, text=True, timeout=timeout, check=False,
        )  # fmt: skip

    return call


def test_a_part_is_measured_printed_and_shown_again(benchmarks: Program, tmp_path: Path) -> None:
    chosen = ("--only", "zenoh.back_to_back", "--only", "unix_datagram.paced")
    done = benchmarks("--quick", *chosen, "--json", "--out", tmp_path / "found.json", timeout=300.0)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found.keys() == KEYS
    assert list(found["measurands"]) == ["zenoh.back_to_back", "unix_datagram.paced"]
    for item in found["measurands"].values():
        assert item["note"] == ""
        assert len(item["quantities"]["round_trip_p50_us"]["values"]) == 1
    assert "[1/1] [2/2] unix_datagram.paced" in done.stderr

    again = benchmarks("--from", tmp_path / "found.json", "--markdown", tmp_path / "page.md")
    assert again.returncode == 0, again.stderr
    assert "zenoh, bare" in again.stdout
    assert "zenoh, bare" in (tmp_path / "page.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "lockstpe"), "--only: there is no 'lockstpe'; did you mean 'lockstep'?"),
        (("--repeats", "0"), "--repeats: must be 1 or more, got 0"),
        (("--out", "nowhere/x.json"), "--out nowhere/x.json: there is no folder"),
        (("--from", "pyproject.toml"), "pyproject.toml: not JSON"),
        (("digest", "docs"), "docs: there is no trials/*/bag.mcap in it; is it a run directory?"),
    ],
)
def test_a_wrong_call_says_what_is_wrong(benchmarks: Program, arguments: tuple[str, ...], message: str) -> None:
    done = benchmarks(*arguments)
    assert done.returncode == 2
    assert message in done.stderr


def test_what_another_version_wrote_is_refused(benchmarks: Program, tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text('{"form": 0}')
    done = benchmarks("--from", tmp_path / "other.json")
    assert done.returncode == 2
    assert "other.json: not written by --out of this version (form 1)" in done.stderr


def test_two_ways_to_run_a_trial_have_one_digest(
    hilrig: Program, benchmarks: Program, experiment: Callable[..., Path], tmp_path: Path
) -> None:
    file = experiment(duration=0.2)
    lines = []
    for name, options in (("a", ("--in-process",)), ("b", ())):
        folder = tmp_path / name
        done = hilrig("run", file, "--no-report", "--out", folder / "runs", *options)
        assert done.returncode == 0, done.stderr
        lines.append(benchmarks("digest", only_run(folder)).stdout)
    assert lines[0] == lines[1]
    assert [word.partition("=")[0] for word in lines[0].split()] == [
        "pd.noisy.0", "/command", "/internals", "/state", "/truth",
    ]  # fmt: skip


def test_the_certificates_cost_is_measured_in_blocks_of_one_trial() -> None:
    """5,300 ticks are five blocks and a bit: with, without, with, without, with."""
    found = certificate_cost(TrialCall(5.3, ("--clock", "lockstep"), program=RIG))
    assert found["blocks"] == 2
    assert -1 < found["certificate_cost"] < 1


def test_a_trial_stamped_throughout_has_no_cost_to_tell() -> None:
    with pytest.raises(RigError, match="no block of ticks without stamps"):
        certificate_cost(TrialCall(0.2, ("--clock", "lockstep")))


@pytest.mark.parametrize("transport", [BARE, SOCKETS], ids=lambda transport: transport.name)
def test_a_pair_makes_its_round_trips(transport: Transport) -> None:
    paced = round_trips(transport, Sizes(100, 68), placement(False, False), 20, 1e-3)
    assert 0 < paced["round_trip_p50_us"] <= paced["round_trip_p99_us"] <= paced["round_trip_max_us"]


def test_a_pair_that_fails_says_why() -> None:
    with pytest.raises(RigError, match="exit code 1: KeyError: 'none'"):
        round_trips(BARE, Sizes(100, 68), placement(False, False)._replace(policy="none"), 20, 0.0)


def test_every_way_in_which_a_trial_fails_ends_with_its_plant_held(benchmarks: Program, tmp_path: Path) -> None:
    """How fast that was is the benchmark's own matter."""
    done = benchmarks("holds", "--trials", "6", "--json", "--out", str(tmp_path / "runs"))
    assert done.returncode in (0, 1), done.stderr
    held = {row["way"]: row["trials"] for row in json.loads(done.stdout)["held"]}
    assert held == dict.fromkeys(("killed", "stopped", "asleep", "busy", "cut", "orphaned"), 1)
