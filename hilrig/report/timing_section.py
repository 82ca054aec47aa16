"""The section "Timing": the timing certificate of every trial, from its timing.json."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hilrig.recording.run_directory import messages_lost
from hilrig.report.dataset import RunData, TrialEntry

TIMES = {
    "lateness": "lateness", "command_age": "command age", "state_transport": "state transport", "compute": "compute",
    "command_transport": "command transport", "round_trip": "round trip",
}  # fmt: skip
"""The quantities in timing.json, and their titles"""
IN_LOCKSTEP = ("compute", "round_trip")
"""Those that are meaningful in lockstep, where the plant waits"""
ONE_WAY = ("state_transport", "command_transport")
"""Those that need a common clock; without one the round trip is shown instead"""


@dataclass(frozen=True)
class TimingRow:
    """The timing of one trial; None for unknown values."""

    trial: str
    ending: str
    ticks: int | None
    speed: float | None
    """Simulated time over wall time"""
    late: int | None
    missed: int | None
    """Those of them that were left out"""
    late_fraction: float | None
    late_by: Mapping[str, int] | None
    """Number of late ticks by cause"""
    times: Mapping[str, Mapping[str, float] | None]
    """p50, p99, p99.9 and max of each quantity, us"""
    lost: int | None
    """Messages that were sent but not stored"""
    valid: bool | None
    """Whether the trial kept its timing budget; None if it had none"""
    reasons: Sequence[str]


@dataclass(frozen=True)
class SetupRow:
    """One setting of the real-time set-up of one process."""

    process: str
    setting: str
    wanted: str
    applied: str
    refused: bool
    """Whether a value other than the wanted one was applied"""
    reason: str
    trials: str
    """The trials to which this applies"""


@dataclass(frozen=True)
class SamplesRow:
    """The samples of one trial's plant."""

    trial: str
    fresh: int
    repeated: int
    jitter: Mapping[str, float] | None
    """p50, p99, p99.9 and max, us"""


@dataclass(frozen=True)
class RefusedRow:
    """Messages of one trial that were refused."""

    trial: str
    channel: str
    reason: str
    number: int


@dataclass(frozen=True)
class TimingSection:
    """What the section shows."""

    realtime: bool
    times: Mapping[str, str]
    """The quantities that are shown, and their titles"""
    rows: list[TimingRow]
    setup: list[SetupRow]
    budget: str
    """In words; "" if there is none"""
    two_clocks: bool
    """Whether driver and controller had different clocks in any trial"""
    unstamped: list[str]
    """Trials with ticks but without time stamps, because they ran in a compiled loop"""
    samples: list[SamplesRow]
    """Of plants with a clock of their own"""
    refused: list[RefusedRow]


def timing_section(run: RunData) -> TimingSection:
    """Return the section of a run."""
    realtime = run.manifest.get("clock") == "realtime"
    two_clocks = any(trial.timing.get("one_clock") is False for trial in run.trials)
    rows = [_row(trial) for trial in run.trials]
    return TimingSection(
        realtime,
        {name: TIMES[name] for name in _shown(realtime, two_clocks)},
        rows,
        _setup(run.trials),
        _budgets(run.trials) if realtime else "",
        two_clocks,
        [row.trial for row in rows if row.ticks and not any(row.times.values())],
        list(_samples(run.trials)),
        list(_refused(run.trials)),
    )


def _samples(trials: Sequence[TrialEntry]) -> Iterator[SamplesRow]:
    for trial in trials:
        if found := trial.timing.get("samples"):
            yield SamplesRow(trial.id, found["fresh"], found["repeated"], found["jitter_us"])


def _refused(trials: Sequence[TrialEntry]) -> Iterator[RefusedRow]:
    for trial in trials:
        for channel, reasons in trial.timing.get("refused", {}).items():
            for reason, number in reasons.items():
                yield RefusedRow(trial.id, channel, reason, number)


def _shown(realtime: bool, two_clocks: bool) -> list[str]:
    """Return the quantities that have a column."""
    if not realtime:
        return [name for name in TIMES if name in IN_LOCKSTEP]
    without = ONE_WAY if two_clocks else ("round_trip",)
    return [name for name in TIMES if name not in without]


def _row(trial: TrialEntry) -> TimingRow:
    outcome, timing = trial.outcome, trial.timing
    return TimingRow(
        trial.id, trial.ending, outcome.get("ticks"), outcome.get("speed"), timing.get("late"),
        timing.get("missed"),
        timing.get("late_fraction"), timing.get("late_by"), {name: timing.get(f"{name}_us") for name in TIMES},
        messages_lost(outcome), timing.get("valid"), timing.get("invalid_because", ()),
    )  # fmt: skip


def _budgets(trials: Sequence[TrialEntry]) -> str:
    """Return the timing budget in words; an experiment has one for all its trials."""
    found = [trial.timing["budget"] for trial in trials if trial.timing.get("budget")]
    if not found:
        return ""
    late, age = 100 * found[0]["late_fraction"], 1e3 * found[0]["command_age_p99"]
    return f"at most {late:g} % late ticks, command age p99 at most {age:g} ms"


def _setup(trials: Sequence[TrialEntry]) -> list[SetupRow]:
    """Return the settings; identical rows of several trials are merged."""
    told = [trial for trial in trials if trial.timing.get("setup")]
    found: dict[tuple[str, str, str, str, str], list[str]] = {}
    for trial in told:
        for process, settings in trial.timing["setup"].items():
            for setting, state in settings.items():
                values = (_text(state.get("wanted")), _text(state.get("applied")), state.get("reason") or "")
                found.setdefault((process, setting, *values), []).append(trial.id)
    return [
        SetupRow(process, setting, wanted, applied, wanted != applied, reason, _which(ids, len(told)))
        for (process, setting, wanted, applied, reason), ids in found.items()
    ]


def _which(ids: Sequence[str], of: int) -> str:
    if len(ids) == of:
        return "all"
    return ids[0] if len(ids) == 1 else f"{len(ids)} of {of}"


def _text(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "–"}[value]
    if isinstance(value, list | tuple):
        return ", ".join(map(_text, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
