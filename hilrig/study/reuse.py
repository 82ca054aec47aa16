"""Reuses existing runs for the experiments of a study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hilrig.core.errors import ExperimentError, nearest
from hilrig.recording.run_directory import find_run, read_manifest
from hilrig.study.loading import Loaded


def match(loaded: Loaded, runs: Sequence[Path], overrides: Sequence[str]) -> dict[str, Path]:
    """Return the run of each experiment that has one, by the experiment's name.

    Raises ExperimentError for a run of another experiment, of a file that has changed since, or with other overrides,
    and for a second run of an experiment; RunDirectoryError for a directory that is not a run.
    """
    found: dict[str, Path] = {}
    for run in runs:
        manifest = read_manifest(find_run(run))
        name, given = str(manifest["name"]), list(manifest.get("overrides", []))
        if name not in loaded.experiments:
            known = ", ".join(loaded.experiments)
            message = f"it is a run of '{name}', which is not part of this study{nearest(name, loaded.experiments)}"
            raise ExperimentError(f"--from {run}: {message} (known: {known})")
        if (run / "experiment.yaml").read_bytes() != loaded.sources[name].read_bytes():
            raise ExperimentError(f"--from {run}: {loaded.sources[name]} has changed since this run; run it again")
        if given != list(overrides):
            was, now = (", ".join(texts) or "none" for texts in (given, overrides))
            raise ExperimentError(f"--from {run}: it was run with other overrides ({was}, now: {now})")
        if name in found:
            raise ExperimentError(f"--from {run}: {found[name]} is already a run of '{name}'; give only one")
        found[name] = run
    return found
