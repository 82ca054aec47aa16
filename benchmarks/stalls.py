"""Tests whether the certificate finds what is late: injects stalls over the bus and compares its findings with them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.stall_matching import Found, compare
from benchmarks.stall_plan import CAUSES, experiment
from hilrig.cli.progress import Display
from hilrig.core.errors import RigError
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.experiment.plan.assessing import assess
from hilrig.experiment.trial import Trial
from hilrig.recording.bag import read_bag
from hilrig.recording.certificate.attribution import attribute
from hilrig.recording.certificate.causes import CAUSES as PROCESSES
from hilrig.recording.certificate.table import join
from hilrig.recording.fault_log import read_faults
from hilrig.recording.recorder import TIMING
from hilrig.recording.run_directory import trial_path
from hilrig.recording.timing import terms_of
from hilrig.rig.execution import Options, execute


def late_ticks(bag: Path, trial: Trial) -> list[Found]:
    """Return the late ticks that the certificate finds in a trial's bag, (tick, cause)."""
    timing = read_bag(bag, TIMING)
    table = join(timing["driver_timing"], timing["controller_timing"])
    found = attribute(table, terms_of(trial.to_document()))
    rows = np.flatnonzero(found.late)
    return [(int(table.driver.tick[row]), PROCESSES[found.cause[row]]) for row in rows]


def measure_stalls(count: int, out: Path, seed: int = 1) -> dict[str, Any]:
    """Inject `count` faults of 1 to 5 ms into driver, controller and bus; return how the certificate judged them.

    Two trials of `count` * 25 ms run over the bus in real time: one undisturbed, which shows the machine's own stalls,
    then one with the faults. The run directory is created in `out`. Keys: those of `stall_matching.compare`, planned,
    run, own_stalls (of the undisturbed trial) and ticks (of each trial). Raises RigError if a trial did not complete.
    """
    out.mkdir(parents=True, exist_ok=True)
    file = out / "stall_benchmark.yaml"
    file.write_text(json.dumps(experiment(count, seed), indent=1), encoding="utf-8")  # JSON is YAML
    loaded = load(file)
    trials = plan(loaded)
    command = ["python", "-m", "benchmarks", "stalls", f"--count={count}", f"--seed={seed}"]
    with Display(len(trials)) as display:
        run, outcomes = execute(loaded, trials, assess(loaded, trials), file, Options(out, command), display)
    if failed := [outcome for outcome in outcomes if not outcome.completed]:
        raise RigError(f"trial {failed[0].trial} ended {failed[0].outcome}: {failed[0].reason}")
    quiet, faulty = trials
    own = late_ticks(trial_path(run, quiet.id) / "bag.mcap", quiet)
    found = late_ticks(trial_path(run, faulty.id) / "bag.mcap", faulty)
    injected = read_faults(trial_path(run, faulty.id))
    judged = compare(injected, found, faulty.period, faulty.actuation_delay)
    apart = [list(stall) for stall in own]
    return {"planned": count, **judged, "own_stalls": apart, "ticks": faulty.ticks, "run": str(run)}


def render(result: dict[str, Any]) -> str:
    """Return the result of `measure_stalls` as text: the figures, then the confusion matrix."""
    columns = [*dict.fromkeys([*CAUSES.values(), "unknown", "missed"])]
    rows = [
        f"{kind:<17}{CAUSES[kind]:>12} |" + "".join(f"{row.get(name, 0):>12}" for name in columns)
        for kind, row in result["confusion"].items()
    ]
    injected, ticks = result["injected"], result["ticks"]
    fewer = "" if injected == result["planned"] else "; the rest had no message to act on: it was lost already"
    return "\n".join([
        f"{injected} of {result['planned']} planned faults injected into {ticks} ticks of 1 ms{fewer}",
        f"detected            {_share(result['detected'], injected)}",
        f"attributed rightly  {_share(result['rightly_attributed'], injected)}",
        f"stalls found that were not injected: {len(result['unexplained'])}; "
        f"in as many ticks without faults, just before: {len(result['own_stalls'])}",
        "",
        f"{'fault':<17}{'cause':>12} |" + "".join(f"{name:>12}" for name in columns) + "   (attributed to)",
        *rows,
    ])  # fmt: skip


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole}" + (f" ({100 * part / whole:.1f} %)" if whole else "")
