"""The faults that the stall benchmark injects, and the experiment for them."""

from __future__ import annotations

from typing import Any

import numpy as np

from hilrig.kinds.disturbances._fault_times import spread

PERIOD = 1e-3
"""s"""
DISTANCE = 15
"""Minimum number of ticks between two faults: the effect of one is over before the next"""
ROOM = 25
"""Ticks of the trial for each fault"""
MARGIN = 200
"""Ticks without faults at the start and at the end"""
LONGEST = 5e-3
"""s"""

KINDS: dict[str, dict[str, Any]] = {
    "driver_stall": {"kind": "stall", "process": "driver"},
    "driver_stop": {"kind": "stall", "process": "driver", "by": "stop"},
    "controller_stall": {"kind": "stall", "process": "controller"},
    "controller_stop": {"kind": "stall", "process": "controller", "by": "stop"},
    "controller_busy": {"kind": "slow_controller"},
    "state_delay": {"kind": "bus_delay", "channel": "state"},
    "command_delay": {"kind": "bus_delay", "channel": "command"},
    "state_loss": {"kind": "bus_loss", "channel": "state"},
    "command_loss": {"kind": "bus_loss", "channel": "command"},
}
"""A disturbance for each field of `hilrig.core.signals.Faults`, without its times and durations"""

CAUSES = {
    kind: fault.get("process", "controller") if "channel" not in fault else "transport" for kind, fault in KINDS.items()
}
"""What the certificate should attribute each kind to"""


def duration_of(count: int) -> float:
    """Return the duration of a trial with `count` faults, s."""
    return (count * ROOM + 2 * MARGIN) * PERIOD


def dealt(count: int, seed: int) -> dict[str, list[int]]:
    """Return random ticks for `count` faults, kind -> ticks: at least `DISTANCE` apart, each kind equally often."""
    random = np.random.default_rng(seed)
    ticks = MARGIN + spread(count, count * ROOM, DISTANCE, random)
    kinds = random.permutation(np.arange(count) % len(KINDS))
    return {kind: ticks[kinds == i].tolist() for i, kind in enumerate(KINDS)}


def experiment(count: int, seed: int) -> dict[str, Any]:
    """Return the experiment: one trial without faults, and one with `count` faults of 1 to 5 ms."""
    faults = [
        {**KINDS[kind], "at": [round(tick * PERIOD, 6) for tick in ticks], **_how_long(kind)}
        for kind, ticks in dealt(count, seed).items()
        if ticks
    ]
    return {
        "hilrig": 1, "name": "stall_benchmark", "clock": "realtime", "seed": seed, "period": PERIOD,
        "question": f"How many of {count} injected faults are detected, and how many attributed rightly?",
        "driver": {
            "kind": "two_link",
            "robot": {"kind": "planar_2r", "lengths": [0.345, 0.2], "masses": [1.8, 1.1], "gravity": [-9.81, 0]},
            "surface": {"position": 0.35, "stiffness": 800, "damping": 20, "friction": 0.2},
        },
        "task": {
            "force_axes": ["z"], "velocity_cutoff": "60 Hz",
            "impedance": {"inertia": [3, 6], "damping": [30, 60], "stiffness": [250, 0]},
        },
        "phases": [{
            "name": "only", "duration": duration_of(count),
            "position": {"kind": "sine", "amplitude": 0.1, "frequency": "0.5 Hz"},
            "force": {"kind": "hold", "value": 3.5},
        }],
        "conditions": {"undisturbed": [], "faults": faults},
        "controllers": {"pd": {"kind": "pd"}},
    }  # fmt: skip


def _how_long(kind: str) -> dict[str, Any]:
    return {} if kind.endswith("_loss") else {"duration": [PERIOD, LONGEST]}
