"""Runs the trials of a plan, one after the other or several at a time, and writes the run directory."""

from __future__ import annotations

import queue
import shlex
import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from hilrig.core.errors import ExperimentError, Stopped, describe_error
from hilrig.core.interfaces import is_fault
from hilrig.core.text import write_text
from hilrig.experiment import Experiment
from hilrig.experiment.expecting import ends_as_expected
from hilrig.experiment.plan.assessing import PlanAssessment
from hilrig.experiment.trial import Trial
from hilrig.kinds.registry import name_of
from hilrig.recording.manifest import provenance
from hilrig.recording.run_directory import create_run, ending, read_outcome, trial_directory, write_json
from hilrig.rig.live import IN_PROCESS, ON_BUS, Live
from hilrig.rig.outcome import Outcome
from hilrig.rig.supervisor import run_on_bus
from hilrig.rig.worker import Worker


class Listener(Protocol):
    """Receives the progress of the trials. Called from several threads if there are several jobs."""

    def opened(self, run: Path) -> None:
        """The run directory exists; no trial has started yet."""
        ...

    def started(self, trial: Trial) -> None:
        """The processes of a trial are being started."""
        ...

    def doing(self, trial: Trial, words: str) -> None:
        """A trial's plant does this before or after the ticks: "approaching, 1.2 N of 3.5 N"; empty in the ticks."""
        ...

    def progressed(self, trial: Trial, tick: int) -> None:
        """A trial has reached `tick`."""
        ...

    def ended(self, trial: Trial, outcome: Outcome) -> None:
        """A trial has ended."""
        ...


@dataclass(frozen=True)
class Options:
    """How to run an experiment."""

    out: Path
    command: Sequence[str]
    overrides: Sequence[str] = ()
    in_process: bool = False
    jobs: int = 1
    fail_fast: bool = False
    stop: threading.Event = field(default_factory=threading.Event)


def execute(
    experiment: Experiment,
    trials: Sequence[Trial],
    assessment: PlanAssessment,
    source: Path,
    options: Options,
    listener: Listener,
) -> tuple[Path, list[Outcome]]:
    """Run all trials of the experiment in file `source`, and write its `assessment` into the plan.

    Returns the run directory and the outcomes of the trials that were started, in the plan's order. Raises
    ExperimentError if the options do not fit the trials.
    """
    if options.in_process:
        _refuse_robot(experiment)
        _refuse_faults(trials)
    plan = {
        "experiment": experiment.to_document(),
        "trials": [trial.to_document() for trial in trials],
        # Stored here because a report may be made on a machine without the robot's code.
        "bounds": assessment.document(),
    }
    run = create_run(options.out, experiment.name, source.read_bytes(), plan)
    manifest = _manifest(experiment, source, options)
    write_json(run / "manifest.json", manifest)
    began = time.monotonic()
    with Live(run, manifest["transport"]) as live:
        listener.opened(run)
        outcomes = _Runner(run, options, listener, plan["experiment"]["expect"], live).run(trials)
    finished = datetime.now(UTC).isoformat(timespec="seconds")
    write_json(
        run / "manifest.json",
        {**manifest, "finished": finished, "wall_s": round(time.monotonic() - began, 3)},
    )
    return run, outcomes


def _refuse_robot(experiment: Experiment) -> None:
    """Raise ExperimentError if the plant is not simulated: in one process nobody watches it while a law hangs."""
    if not experiment.driver.capabilities.simulated:
        kind = name_of(type(experiment.driver))[1]
        raise ExperimentError(
            f"--in-process: the plant of driver '{kind}' is not simulated, so it needs a watchdog in another process; "
            "run it without --in-process"
        )


def _refuse_faults(trials: Sequence[Trial]) -> None:
    """Raise ExperimentError if a condition has faults: one process has no bus and no other process to stall."""
    for trial in trials:
        for disturbance in trial.disturbances:
            if is_fault(disturbance):
                kind = name_of(type(disturbance))[1]
                raise ExperimentError(
                    f"--in-process: condition '{trial.condition_name}' has the fault '{kind}', which needs the "
                    "processes on the bus; run it without --in-process"
                )


def _manifest(experiment: Experiment, source: Path, options: Options) -> dict[str, Any]:
    return {
        "name": experiment.name,
        "question": experiment.question,
        "command": shlex.join(options.command),
        "overrides": list(options.overrides),
        "seed": experiment.seed,
        "clock": experiment.clock,
        "transport": IN_PROCESS if options.in_process else ON_BUS,
        "jobs": options.jobs,
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "finished": None,
        "wall_s": None,
        **provenance(source.resolve()),
    }


class _Runner:
    """Runs the trials, `jobs` at a time, each in its own slot, which decides its cores."""

    def __init__(
        self, run: Path, options: Options, listener: Listener, expect: Sequence[Mapping[str, Any]], live: Live
    ) -> None:
        self._run, self._options, self._listener, self._expect = run, options, listener, expect
        self._live = live
        self._failed = threading.Event()
        self._slots: queue.SimpleQueue[int] = queue.SimpleQueue()
        for slot in range(options.jobs):
            self._slots.put(slot)
        slots = [None] if options.jobs == 1 else range(options.jobs)
        self._workers = [Worker(run, slot) for slot in slots] if options.in_process else []

    def run(self, trials: Sequence[Trial]) -> list[Outcome]:
        """Run the trials; return the outcomes of those that were started."""
        with ThreadPoolExecutor(self._options.jobs) as pool:
            do = pool.map if self._options.jobs > 1 else map
            try:
                return [outcome for outcome in do(self._one, trials) if outcome is not None]
            finally:
                # Before the threads that started them end, which a worker would take for the end of this process.
                for worker in self._workers:
                    worker.close()

    def _stopped(self) -> bool:
        return self._options.stop.is_set() or (self._options.fail_fast and self._failed.is_set())

    def _one(self, trial: Trial) -> Outcome | None:
        if self._stopped():
            return None
        slot = self._slots.get()
        try:
            self._listener.started(trial)
            outcome = self._run_trial(trial, slot)
        finally:
            self._slots.put(slot)
        write_json(trial_directory(self._run, trial.id) / "outcome.json", outcome.document())
        ended = ending(read_outcome(self._run, trial.id))
        expected = ends_as_expected(self._expect, trial.controller_name, trial.condition_name, ended)
        if ended != "completed" and not expected:
            self._failed.set()
        self._listener.ended(trial, outcome)
        return outcome

    def _run_trial(self, trial: Trial, slot: int) -> Outcome:
        """Run one trial; an error becomes its outcome, and the other trials continue."""
        report = partial(self._listener.progressed, trial)
        try:
            if self._workers:
                return self._workers[slot].do(trial, report, self._options.stop.is_set)
            doing = partial(self._listener.doing, trial)
            return run_on_bus(self._run, trial, report, self._options.stop.is_set, slot, self._live, doing)
        except Stopped as stop:  # outside the ticks, where the trial does not turn it into an outcome
            return Outcome.of(trial, "aborted", str(stop), 0, 0.0, {})
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a law that exits the program, or is cancelled, ends only its own trial
            log = trial_directory(self._run, trial.id) / "logs" / "supervisor.log"
            write_text(log, "".join(traceback.format_exception(error)))
            return Outcome.of(trial, "failed", f"{describe_error(error)} (see {log})", 0, 0.0, {})
