"""The run directory: what it holds, and how to write and read it."""

from __future__ import annotations

import itertools
import json
import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hilrig.core.errors import RunDirectoryError
from hilrig.recording.bag import is_whole

if TYPE_CHECKING:
    from hilrig.experiment.trial import Trial

DAMAGED = "damaged"
"""Outcome of a trial that completed, but whose bag has since been cut or removed"""
DRIVER_RECORD = "driver.json"
"""File in a trial's directory in which its driver's process says how the trial ended, also if nobody listens"""
INVALID = "invalid"
"""Outcome of a real-time trial that ended outside its timing budget"""
PARTS = ("experiment.yaml", "manifest.json", "plan.json", "trials")


def create_run(out: Path, name: str, experiment: bytes, plan: Mapping[str, Any]) -> Path:
    """Create a run directory <utc>-<name> below `out`, with the plan and an exact copy of the experiment file."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    run = _new_directory(out / f"{stamp}-{name}")
    (run / "trials").mkdir()
    (run / "experiment.yaml").write_bytes(experiment)
    write_json(run / "plan.json", plan)
    return run


def _new_directory(path: Path) -> Path:
    """Create and return `path`, with -2, -3 ... appended if several runs start within a second."""
    for number in itertools.count(1):
        candidate = path if number == 1 else path.with_name(f"{path.name}-{number}")
        with suppress(FileExistsError):
            make_directory(candidate)
            return candidate
    raise AssertionError("unreachable")


def make_directory(path: Path) -> None:
    """Create a directory that does not exist yet. Raises FileExistsError, or RunDirectoryError with the reason."""
    try:
        path.mkdir(parents=True)
    except FileExistsError:
        if not path.is_dir():
            raise RunDirectoryError(f"{path}: cannot make this directory: there is a file of that name") from None
        raise
    except OSError as error:
        raise RunDirectoryError(f"{path}: cannot make this directory: {error.strerror}") from error


def trial_path(run: Path, trial: str) -> Path:
    """Return where the files of one trial are."""
    return run / "trials" / trial


def trial_directory(run: Path, trial: str) -> Path:
    """Return the directory of one trial, and create it if it does not exist."""
    directory = trial_path(run, trial)
    (directory / "logs").mkdir(parents=True, exist_ok=True)
    return directory


def write_json(path: Path, document: Any) -> None:
    """Write a document. A crash leaves the old file or the new one, never a partial one."""
    partial = path.with_name(f".{path.name}.part")
    partial.write_text(to_json(document) + "\n", encoding="utf-8")
    os.replace(partial, path)


def to_json(document: Any) -> str:
    """Return a document as JSON, with null for infinities and NaN, which JSON does not have."""
    return json.dumps(_finite(document), indent=2, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read_json(path: Path) -> Any:
    """Return the document in `path`. Raises RunDirectoryError if there is no such file, or if it is not JSON."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RunDirectoryError(f"{path}: there is no such file; is {path.parent} a run directory?") from None
    except ValueError as error:
        raise RunDirectoryError(f"{path}: not JSON ({error})") from error


def read_plan(run: Path) -> dict[str, Any]:
    """Return a run's plan: the experiment and its trials. Raises RunDirectoryError."""
    return _document(run / "plan.json", ("experiment", "trials"))


def read_manifest(run: Path) -> dict[str, Any]:
    """Return a run's manifest: its name, settings and provenance. Raises RunDirectoryError."""
    return _document(run / "manifest.json", ("name", "question", "command", "clock", "seed", "commit"))


def _document(path: Path, needed: tuple[str, ...]) -> dict[str, Any]:
    document = read_json(path)
    missing = [key for key in needed if not isinstance(document, dict) or key not in document]
    if missing:
        raise RunDirectoryError(f"{path}: damaged: it lacks {', '.join(missing)}")
    return document


def find_run(path: Path) -> Path:
    """Return `path` if it is a run directory. Raises RunDirectoryError with what is missing."""
    if not path.is_dir():
        raise RunDirectoryError(f"{path}: there is no such directory")
    lacking = [part for part in PARTS if not (path / part).exists()]
    if lacking:
        raise RunDirectoryError(f"{path}: not a run directory: it lacks {', '.join(lacking)}")
    return path


def list_runs(out: Path) -> list[Path]:
    """Return the run directories below `out`, oldest first."""
    if not out.is_dir():
        return []
    return sorted(path for path in out.iterdir() if all((path / part).exists() for part in PARTS))


def read_trial(run: Path, trial: str) -> Trial:
    """Return one trial of the plan. Raises RunDirectoryError if it has no such trial."""
    from hilrig.experiment.trial import Trial  # this loads all kinds and numba, which no other reader of a run needs

    return Trial.from_document(read_trial_document(run, trial))


def read_trial_document(run: Path, trial: str) -> Mapping[str, Any]:
    """Return one trial's document in the plan. Raises RunDirectoryError if the plan has no such trial."""
    documents: Sequence[Mapping[str, Any]] = read_plan(run)["trials"]
    for document in documents:
        if document["id"] == trial:
            return document
    raise RunDirectoryError(f"{run}: the plan has no trial '{trial}'")


def read_outcome(run: Path, trial: str) -> dict[str, Any]:
    """Return the outcome of one trial; if the run left none, "aborted" if the trial was begun, else "not run".

    A completed trial is "damaged" if its bag is no longer complete. `invalid_because` says why the trial is outside its
    timing budget according to its timing.json; it is empty if the trial is within the budget or has none.
    """
    outcome = _outcome(run, trial)
    timing = trial_path(run, trial) / "timing.json"
    reasons = read_json(timing).get("invalid_because", []) if timing.is_file() else []
    return {**outcome, "invalid_because": reasons}


def ending(outcome: Mapping[str, Any]) -> str:
    """Return how a trial ended, from its outcome as `read_outcome` returns it: "invalid" if outside its timing budget.

    Only completed or tripped trials become invalid: neither proves anything if the loop did not keep its period. Failed
    and aborted trials keep theirs.
    """
    counts = outcome["outcome"] in ("completed", "tripped")
    return INVALID if counts and outcome.get("invalid_because") else outcome["outcome"]


def reason_of(outcome: Mapping[str, Any]) -> str:
    """Return the reason for `ending` in one line; empty if the trial completed and is valid."""
    if ending(outcome) != INVALID:
        return outcome.get("reason", "")
    before = f"{outcome['outcome']}: {outcome['reason']}; " if outcome.get("reason") else ""
    return f"{before}outside its timing budget: {'; '.join(outcome['invalid_because'])}"


def _outcome(run: Path, trial: str) -> dict[str, Any]:
    """Return the outcome, regardless of the trial's timing."""
    folder = trial_path(run, trial)
    if (folder / "outcome.json").is_file():
        outcome = read_json(folder / "outcome.json")
        whole = outcome["outcome"] != "completed" or is_whole(folder / "bag.mcap")
        damage = {"outcome": DAMAGED, "reason": "it completed, but its bag.mcap has since been cut or removed"}
        return outcome if whole else {**outcome, **damage}
    begun = folder.is_dir()
    reason_of = f"the run ended before this trial {'did' if begun else 'began'}"
    return {
        "trial": trial, "outcome": "aborted" if begun else "not run", "reason": reason_of, "ticks": 0, "channels": {},
    }  # fmt: skip


def read_driver_record(folder: Path) -> dict[str, Any]:
    """Return what the driver's process left in a trial's directory when it ended; empty if it left nothing."""
    path = folder / DRIVER_RECORD
    return read_json(path) if path.is_file() else {}


def messages_lost(outcome: Mapping[str, Any]) -> int | None:
    """Return how many messages of a trial were sent but not stored; None if unknown."""
    lost = [account["lost"] for account in outcome["channels"].values()]
    return None if None in lost or not lost else sum(lost)
