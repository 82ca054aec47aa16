"""What tests of the report are made of: run directories of known signals, and tables of metrics."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from helpers.loop_simulation import Loop
from hilrig.experiment.timing_budget import TimingBudget
from hilrig.recording.bag import read_bag
from hilrig.recording.bag_writer import BagWriter
from hilrig.recording.messages.codec import Codec, Definition, definition, extended
from hilrig.recording.messages.record_batch import RecordBatch
from hilrig.recording.timing import certify, terms_of
from hilrig.report.dataset import TrialEntry
from hilrig.report.measures import METRIC_COLUMNS

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
        "axes": ["x", "z"],
        "driver": {"kind": "two_link", "robot": ROBOT},
        "controller": {"kind": "pd"},
        "task": {
            "force_axes": ["z"],
            "inertia": [3.0, 6.0],
            "damping": [30.0, 60.0],
            "stiffness": [250.0, 0.0],
            "states": "measured",
            "velocity_cutoff": 100.0,
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
        "state": (definition("State"), [joints, wrench, s["torque"], s["time"], s.get("fresh", np.ones(n))]),
        "truth": (definition("Truth"), [joints, joints, s["position"], s["velocity"], wrench, np.full(n, 0.35)]),
        "command": (definition("Command"), [s["torque"], joints, s["torque"], s.get("limited", np.zeros(n))]),
        "internals": (
            extended(definition("Internals"), MEMORY),
            [s["position"], s["velocity"], force, s["reference_position"], s["reference_velocity"],
             s["reference_acceleration"], s["reference_force"], *memory.values()],
        ),
    }  # fmt: skip
    if not truth:
        del columns["truth"]
    ticks = np.arange(n)
    with BagWriter(path) as bag:
        for name, (shape, _) in columns.items():
            bag.add_channel(name, shape)
        for name, (shape, arrays) in columns.items():
            sizes = {f.name: a.shape[1] for f, a in zip(shape.fields[2:], arrays, strict=True) if f.size == 0}
            batch = RecordBatch(Codec(shape, sizes), n)
            for field, values in zip(batch.fields, (ticks, s["time"], *arrays), strict=True):
                field[:] = values
            bag.write(name, batch.payloads, ticks, PERIOD)


def make_run(
    path: Path,
    controllers: dict[str, float],
    conditions: tuple[str, ...] = ("quiet",),
    repeats: int = 3,
    seconds: float = 1.0,
    failed: tuple[str, ...] = (),
    expect: tuple[dict, ...] = (),
    truth: bool = True,
    seed: int = 7,
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
        "host": {"node": "n", "system": "s", "cpu": "c", "cores": 2, "memory_gib": 4.0}, "seed": seed,
        "command": "hilrig run experiments/x.yaml", "overrides": ["repeats=3"], "clock": "lockstep",
        "transport": "in-process", "started": "2026-01-01T00:00:00Z", "finished": None, "wall_s": 3.0,
    }  # fmt: skip
    (path / "manifest.json").write_text(json.dumps(manifest))
    (path / "experiment.yaml").write_text("hilrig: 1\nquestion: <b>Which</b>?\n")
    return path


def in_real_time(run: Path, loops: dict[str, Loop], setup: dict | None = None, one_clock: bool = True) -> Path:
    """Make a run, from `make_run`, one in real time: by trial id a loop that was simulated, with its certificate."""
    plan, manifest = (json.loads((run / name).read_text()) for name in ("plan.json", "manifest.json"))
    for trial in plan["trials"]:
        trial.update(clock="realtime", actuation_delay=1)
    for trial in plan["trials"]:
        if trial["id"] not in loops:
            continue
        folder = run / "trials" / trial["id"]
        channels = read_bag(folder / "bag.mcap")
        stamps = dict(zip(("driver_timing", "controller_timing"), loops[trial["id"]].columns(), strict=True))
        with BagWriter(folder / "bag.mcap") as bag:
            for name, fields in channels.items():
                shape = {
                    "state": definition("State"), "truth": definition("Truth"), "command": definition("Command"),
                    "internals": extended(definition("Internals"), MEMORY),
                }[name]  # fmt: skip
                write_rows(bag, name, shape, fields)
            for name, kind in zip(stamps, ("DriverTiming", "ControllerTiming"), strict=True):
                none = 0 * stamps[name]["tick"]
                fields = {"sampled": none, "fresh": 1 + none, **stamps[name], "time": stamps[name]["tick"] * PERIOD}
                write_rows(bag, name, definition(kind), fields)
        certificate = certify(terms_of(trial), TimingBudget(), stamps, setup, one_clock)
        (folder / "timing.json").write_text(json.dumps(certificate))
    (run / "plan.json").write_text(json.dumps(plan))
    (run / "manifest.json").write_text(json.dumps({**manifest, "clock": "realtime", "transport": "zenoh"}))
    return run


def write_rows(bag: BagWriter, name: str, shape: Definition, fields: dict[str, np.ndarray]) -> None:
    """Write a channel's messages, one for each row."""
    bag.add_channel(name, shape)
    sizes = {f.name: fields[f.name].shape[1] for f in shape.fields if f.size == 0}
    batch = RecordBatch(Codec(shape, sizes), fields["tick"].size)
    for field, values in zip(shape.fields, batch.fields, strict=True):
        values[:] = fields[field.name]
    bag.write(name, batch.payloads, fields["tick"], PERIOD)


SIZES = {"small": 1.0, "large": 3.0}


def metric_table(
    values: dict[str, list[float]],
    metric: str = "position_rmse",
    axis: str = "x",
    unit: str = "m",
    phase: str = "all",
    condition: str = "quiet",
) -> pd.DataFrame:
    """Return the tidy table of one cell: each controller with its values over the repeats."""
    rows = [
        (f"{name}.{condition}.{repeat}", name, condition, repeat, phase, metric, axis, value, unit)
        for name, column in values.items()
        for repeat, value in enumerate(column)
    ]
    return pd.DataFrame(rows, columns=list(METRIC_COLUMNS))


def trial_entry(
    controller: str,
    condition: str = "quiet",
    repeat: int = 0,
    outcome: str = "completed",
    phases: tuple[dict, ...] = (),
) -> TrialEntry:
    """Return a planned trial without files."""
    document = trial_document(controller, condition, repeat, list(phases))
    return TrialEntry(Path(document["id"]), document, {"outcome": outcome}, {})
