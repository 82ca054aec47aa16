"""The section "Limits": how often each controller's commands were limited, and how many of its trials a limit ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hilrig.loop.limited import WORDS
from hilrig.report.dataset import Channels, RunData

TICKS = "ticks"
"""Key of the number of all ticks"""
ANY = "any"
"""Stands for all limits together: a tick at which two limits changed the command counts once"""


@dataclass(frozen=True)
class LimitRow:
    """What the limits did to one controller."""

    controller: str
    trials: int
    tripped: int
    """Trials that a safety limit ended"""
    ticks: int
    """Recorded ticks of its trials for which it is known whether a limit changed the command"""
    shares: dict[str, float | None]
    """Part of these ticks at which a limit changed the command, by limit and for `ANY`; None without ticks"""


@dataclass(frozen=True)
class LimitsSection:
    """What the section shows."""

    known: bool
    """Whether the bags say what was limited; those of older hilrig versions do not"""
    limits: list[str]
    """The limits that changed a command, in words"""
    rows: list[LimitRow]


def limited_ticks(channels: Channels) -> dict[str, int] | None:
    """Return the number of ticks: all with a command, those limited by `ANY`, and by each limit; None if not recorded.

    The controller bounds the torque that its law asks for; the driver bounds again what the plant receives.
    """
    command = channels.get("command", {})
    if "limited" not in command:
        return None
    bits = dict(zip(command["tick"].tolist(), command["limited"].tolist(), strict=True))
    count = len(bits)
    applied = channels.get("applied", {"tick": np.zeros(0, int), "limited": np.zeros(0, int)})
    for tick, changed in zip(applied["tick"].tolist(), applied["limited"].tolist(), strict=True):
        bits[tick] = bits.get(tick, 0) | changed
    found = np.array(list(bits.values()), dtype=np.int64)
    by_limit = {word: int(np.count_nonzero(found & int(bit))) for bit, word in WORDS.items()}
    return {TICKS: count, ANY: int(np.count_nonzero(found)), **by_limit}


def limits_section(run: RunData, limited: Mapping[str, Mapping[str, int]]) -> LimitsSection:
    """Return the section; `limited` is what `limited_ticks` returned, by trial, for the bags that say it."""
    rows = [_row(run, name, limited) for name in run.controllers]
    words = [word for word in WORDS.values() if any(row.shares[word] for row in rows)]
    return LimitsSection(bool(limited), words, rows)


def _row(run: RunData, controller: str, limited: Mapping[str, Mapping[str, int]]) -> LimitRow:
    trials = [trial for trial in run.trials if trial.controller == controller]
    counts = [limited[trial.id] for trial in trials if trial.id in limited]
    ticks = sum(count[TICKS] for count in counts)
    shares = {name: sum(count[name] for count in counts) / ticks if ticks else None for name in (ANY, *WORDS.values())}
    tripped = sum(trial.outcome["outcome"] == "tripped" for trial in trials)
    return LimitRow(controller, len(trials), tripped, ticks, shares)
