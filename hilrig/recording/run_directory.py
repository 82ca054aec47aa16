"""The run directory: what it holds, and how it is written and read."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from hilrig.errors import RunDirectoryError
from hilrig.trial import Trial

OUTCOMES = ("completed", "tripped", "aborted", "timed_out", "failed")
PARTS = ("experiment.yaml", "manifest.json", "plan.json", "trials")


def create_run(out: Path, name: str, experiment: bytes, plan: Mapping[str, Any]) -> Path:
    """Make a new run directory below `out`: <utc>-<name>, with the experiment byte for byte and the plan."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    run = _unused(out / f"{stamp}-{name}")
    (run / "trials").mkdir(parents=True)
    (run / "experiment.yaml").write_bytes(experiment)
    write_json(run / "plan.json", plan)
    return run


def _unused(path: Path) -> Path:
    """Return `path`, or with -2, -3 ... behind it if two runs begin within a second."""
    candidate, number = path, 1
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.name}-{number}")
    return candidate


def trial_directory(run: Path, trial: str) -> Path:
    """Return the directory of one trial, made if need be."""
    directory = run / "trials" / trial
    (directory / "logs").mkdir(parents=True, exist_ok=True)
    return directory


def write_json(path: Path, document: Any) -> None:
    """Write a document so that a crash leaves the old file or the new one, never half of one."""
    partial = path.with_name(f".{path.name}.part")
    partial.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    os.replace(partial, path)


def read_json(path: Path) -> Any:
    """Return the document in `path`. Raises RunDirectoryError if there is none or it is broken."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RunDirectoryError(f"{path}: there is no such file; is {path.parent} a run directory?") from None
    except ValueError as error:
        raise RunDirectoryError(f"{path}: not JSON ({error})") from error


def find_run(path: Path) -> Path:
    """Return `path` if it is a run directory. Raises RunDirectoryError naming what it lacks."""
    if not path.is_dir():
        raise RunDirectoryError(f"{path}: there is no such directory")
    lacking = [part for part in PARTS if not (path / part).exists()]
    if lacking:
        raise RunDirectoryError(f"{path}: not a run directory, it has no {', '.join(lacking)}")
    return path


def list_runs(out: Path) -> list[Path]:
    """Return the run directories below `out`, oldest first."""
    if not out.is_dir():
        return []
    return sorted(path for path in out.iterdir() if all((path / part).exists() for part in PARTS))


def read_trials(run: Path) -> list[Trial]:
    """Return the trials of the plan, in order."""
    return [Trial.from_document(document) for document in read_json(run / "plan.json")["trials"]]


def read_trial(run: Path, trial: str) -> Trial:
    """Return one trial of the plan. Raises RunDirectoryError if it has no such trial."""
    documents: Sequence[Mapping[str, Any]] = read_json(run / "plan.json")["trials"]
    for document in documents:
        if document["id"] == trial:
            return Trial.from_document(document)
    raise RunDirectoryError(f"{run}: its plan has no trial '{trial}'")


def read_outcome(run: Path, trial: str) -> dict[str, Any]:
    """Return the outcome of one trial; one that has none was never finished."""
    path = run / "trials" / trial / "outcome.json"
    if not path.is_file():
        return {
            "trial": trial,
            "outcome": "aborted",
            "reason": "never run to its end",
            "ticks": 0,
            "channels": {},
        }
    return read_json(path)
