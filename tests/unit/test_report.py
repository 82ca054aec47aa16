"""The report, from synthetic run directories: every number on the page is known beforehand."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hilrig.errors import RunDirectoryError
from hilrig.messages.codec import Codec, definition, extended
from hilrig.recording.bag import BagWriter
from hilrig.report import compare, make_report, render

PERIOD = 1e-3
ROBOT = {
    "kind": "planar_2r", "lengths": [0.345, 0.2], "masses": [1.8, 1.1], "gravity": [-9.81, 0.0],
}  # fmt: skip
MEMORY = {"filter_position": 2, "gains": 3, "estimate": 2}


def experiment(name: str, phases: list[dict], controllers: list[str], expect: list[dict]) -> dict:
    return {
        "hilrig": 1, "name": name, "question": "Which controller keeps 3.5 N?", "period": PERIOD, "clock": "lockstep",
        "phases": phases, "controllers": {c: {"kind": "pd"} for c in controllers}, "expect": expect,
    }  # fmt: skip


def trial_document(controller: str, condition: str, repeat: int, phases: list[dict]) -> dict:
    return {
        "id": f"{controller}.{condition}.{repeat}",
        "controller_name": controller,
        "condition_name": condition,
        "repeat": repeat,
        "seed": [7, repeat],
        "period": PERIOD,
        "driver": {"kind": "two_link", "robot": ROBOT},
        "controller": {"kind": "pd"},
        "task": {
            "force_axes": ["z"],
            "inertia": [3.0, 6.0],
            "damping": [30.0, 60.0],
            "stiffness": [250.0, 0.0],
            "states": "measured",
        },
        "phases": phases,
    }


def signals(ticks: int, size: float, seed: int) -> dict[str, np.ndarray]:
    """A made-up trial whose errors grow with `size`."""
    time = np.arange(ticks) * PERIOD
    random = np.random.default_rng(seed)
    amplitude = np.where(time < time[-1] / 2, 0.3, 0.2)
    zero = np.zeros(ticks)
    desired = np.stack([amplitude * np.sin(time), zero], axis=1)
    error = size * np.stack([0.01 * np.cos(3 * time), zero], axis=1)
    position = desired - error + np.array([0.0, 0.35])
    force = 3.5 * (1 - np.exp(-time / 0.05)) + size * (0.2 * np.sin(5 * time) + 0.02 * random.standard_normal(ticks))
    return {
        "time": time, "position": position, "velocity": np.gradient(position, PERIOD, axis=0), "force": force,
        "reference_position": desired, "reference_velocity": np.stack([amplitude * np.cos(time), zero], axis=1),
        "reference_acceleration": np.stack([-amplitude * np.sin(time), zero], axis=1),
        "reference_force": np.stack([zero, zero + 3.5], axis=1),
        "torque": np.stack([5 + np.sin(time), 1 + size * 0.1 * random.standard_normal(ticks)], axis=1),
    }  # fmt: skip


def write_bag(path: Path, s: dict[str, np.ndarray], truth: bool = True) -> None:
    """Record the signals as the rig does."""
    n = s["time"].size
    wrench = np.zeros((n, 6))
    wrench[:, 2] = s["force"]
    joints = np.zeros((n, 2))
    memory = {name: np.cumsum(np.ones((n, k)), axis=0) / n for name, k in MEMORY.items()}
    force = wrench[:, [0, 2]]
    columns = {
        "state": (definition("State"), [joints, wrench, s["torque"]]),
        "truth": (definition("Truth"), [joints, joints, s["position"], s["velocity"], wrench, np.full(n, 0.35)]),
        "command": (definition("Command"), [s["torque"], joints]),
        "internals": (
            extended(definition("Internals"), MEMORY),
            [s["position"], s["velocity"], force, s["reference_position"], s["reference_velocity"],
             s["reference_acceleration"], s["reference_force"], *memory.values()],
        ),
    }  # fmt: skip
    if not truth:
        del columns["truth"]
    with BagWriter(path) as bag:
        codecs = {}
        for name, (shape, arrays) in columns.items():
            bag.add_channel(name, shape)
            sizes = {f.name: a.shape[1] for f, a in zip(shape.fields[2:], arrays, strict=True) if f.size == 0}
            codecs[name] = Codec(shape, sizes)
        for k in range(n):
            for name, (_, arrays) in columns.items():
                bag.write(name, codecs[name].pack([k, s["time"][k], *(a[k] for a in arrays)]), k, PERIOD)


def make_run(
    path: Path,
    controllers: dict[str, float],
    conditions: tuple[str, ...] = ("quiet",),
    repeats: int = 3,
    seconds: float = 1.0,
    failed: tuple[str, ...] = (),
    expect: tuple[dict, ...] = (),
    truth: bool = True,
) -> Path:
    """Write a run directory: each controller with the size of its errors; ids in `failed` tripped."""
    half = seconds / 2
    phases = [{"name": "before", "start": 0.0, "end": half}, {"name": "after", "start": half, "end": seconds}]
    trials = [
        trial_document(controller, condition, repeat, phases)
        for repeat in range(repeats)
        for condition in conditions
        for controller in controllers
    ]
    ticks = round(seconds / PERIOD)
    for trial in trials:
        folder = path / "trials" / trial["id"]
        folder.mkdir(parents=True)
        tripped = trial["id"] in failed
        data = signals(ticks, controllers[trial["controller_name"]], trial["repeat"])
        data = {k: v[: ticks // 2] for k, v in data.items()} if tripped else data
        write_bag(folder / "bag.mcap", data, truth)
        outcome = {
            "trial": trial["id"], "outcome": "tripped" if tripped else "completed",
            "reason": "force above 200 N at t = 0.5 s" if tripped else "", "ticks": data["time"].size,
            "planned_ticks": ticks, "wall_s": 1.0, "speed": seconds,
            "channels": {"state": {"sent": ticks, "stored": ticks, "lost": 0, "gaps": []}},
        }  # fmt: skip
        (folder / "outcome.json").write_text(json.dumps(outcome))
        times = {"p50": 80.0, "p99": 200.0, "p99.9": 500.0, "max": 900.0}
        timing = {
            "clock": "lockstep", "ticks": ticks, "late": 0, "late_fraction": 0.0, "lateness_us": None,
            "round_trip_us": times, "compute_us": times,
        }  # fmt: skip
        (folder / "timing.json").write_text(json.dumps(timing))
    document = experiment(path.name, phases, list(controllers), list(expect))
    (path / "plan.json").write_text(json.dumps({"experiment": document, "trials": trials}))
    manifest = {
        "hilrig": "0.1.0", "name": path.name, "question": document["question"], "commit": "abc123", "dirty": True,
        "diff": "-old\n+new", "versions": {"numpy": np.__version__}, "python": "3.11",
        "host": {"node": "n", "system": "s", "cpu": "c", "cores": 2, "memory_gib": 4.0}, "seed": 7,
        "command": "hilrig run experiments/x.yaml", "overrides": ["repeats=3"], "clock": "lockstep",
        "transport": "in-process", "started": "2026-01-01T00:00:00Z", "finished": None, "wall_s": 3.0,
    }  # fmt: skip
    (path / "manifest.json").write_text(json.dumps(manifest))
    (path / "experiment.yaml").write_text("hilrig: 1\nquestion: <b>Which</b>?\n")
    return path


SIZES = {"small": 1.0, "large": 3.0}


def report(run: Path, tmp_path: Path) -> tuple[str, dict]:
    page = make_report(run, tmp_path / "out")
    return page.read_text(encoding="utf-8"), json.loads((tmp_path / "out" / "summary.json").read_text())


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, dict]:
    """A run of two controllers, one trial of which tripped, and its report."""
    folder = tmp_path_factory.mktemp("report")
    expect = {"metric": "position_rmse", "controller": "small", "phase": "after", "axis": None, "condition": None}
    expect = ({**expect, "below": 0.1, "above": None}, {**expect, "below": 1e-6, "above": None})
    run = make_run(folder / "run", SIZES, failed=("large.quiet.2",), expect=expect)
    return folder, *report(run, folder)


def test_the_page_needs_no_other_file(reported: tuple[Path, str, dict]) -> None:
    _, page, _ = reported
    found = re.findall(r"""(?:src|href|url)\s*[=(]\s*["']?([^"')\s>]+)""", page)
    assert found
    assert all(target.startswith(("data:", "#")) for target in found)
    assert "<script" not in page
    assert "@import" not in page


def test_the_page_says_what_it_must(reported: tuple[Path, str, dict]) -> None:
    _, page, _ = reported
    for words in (
        "Which controller keeps 3.5 N?", "abc123", "uncommitted changes", "hilrig run experiments/x.yaml", "repeats=3",
        "95 % t interval", "not met", "RMSE_i", "lower is better",
    ):  # fmt: skip
        assert words in page
    assert "&lt;b&gt;Which&lt;/b&gt;" in page, "the experiment's text is escaped"


def test_a_failed_trial_is_listed_and_left_out(reported: tuple[Path, str, dict]) -> None:
    folder, page, summary = reported
    assert "force above 200 N at t = 0.5 s" in page
    table = pd.read_csv(folder / "out" / "metrics.csv")
    assert "large.quiet.2" not in set(table["trial"])
    assert {o["trial"]: o["outcome"] for o in summary["outcomes"]}["large.quiet.2"] == "tripped"


def test_metrics_are_those_of_the_signals(reported: tuple[Path, str, dict]) -> None:
    """x error: size * 0.01 cos 3t; its mean square over [0, 1 s] is known."""
    folder, _, _ = reported
    table = pd.read_csv(folder / "run" / "metrics.csv").set_index(["trial", "phase", "metric", "axis"])["value"]
    expected = 3.0 * 0.01 * np.sqrt(np.mean(np.cos(3 * np.arange(1000) * PERIOD) ** 2))
    assert table["large.quiet.0", "all", "position_rmse", "x"] == pytest.approx(expected, rel=1e-9)


def test_every_figure_is_there_twice(reported: tuple[Path, str, dict]) -> None:
    folder, _, _ = reported
    files = {path.name for path in (folder / "out" / "figures").iterdir()}
    stems = ("position_x", "position_error_x", "force_error_z", "auxiliary_error_z", "effort", "internals_small")
    assert {f"quiet_{stem}.{ending}" for stem in stems for ending in ("svg", "png")} <= files


def test_the_same_run_makes_the_same_page(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", SIZES, repeats=1)
    pages = [make_report(run, tmp_path / name).read_bytes() for name in "ab"]
    assert pages[0] == pages[1]


def test_a_plant_without_truth_is_reported_as_measured(tmp_path: Path) -> None:
    page, _ = report(make_run(tmp_path / "run", SIZES, repeats=1, truth=False), tmp_path)
    assert "as measured by the sensors" in page


def test_all_trials_failed(tmp_path: Path) -> None:
    page, summary = report(make_run(tmp_path / "run", {"small": 1.0}, repeats=1, failed=("small.quiet.0",)), tmp_path)
    assert "No trial completed" in page
    assert summary["verdicts"] == []


def test_not_a_run(tmp_path: Path) -> None:
    with pytest.raises(RunDirectoryError):
        make_report(tmp_path)


def test_two_runs_are_compared_in_pairs(tmp_path: Path) -> None:
    a = make_run(tmp_path / "a", {"only": 1.0})
    b = make_run(tmp_path / "b", {"only": 2.0})
    table = compare(a, b).set_index(["phase", "metric", "axis"])
    row = table.loc[("all", "position_rmse", "x")]
    assert row["difference"] == pytest.approx(row["a"])
    assert row["repeats"] == 3
    assert row["low"] > 0
    assert "position_rmse x [m]" in render(compare(a, b))
