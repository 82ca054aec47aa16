"""Runs that are there already, taken for the experiments of a study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hilrig.core.errors import ExperimentError, nearest
from hilrig.recording.run_directory import find_run, read_manifest
from hilrig.study.loading import Loaded


def match(loaded: Loaded, runs: Sequence[Path], overrides: Sequence[str]) -> dict[str, Path]:
    """Return which run is of which experiment, by the experiment's name.

    Raises ExperimentError for a run of another experiment, of another text of the file, with other overrides, or for a
    second run of one experiment; RunDirectoryError for a directory that is no run.
    """
    found: dict[str, Path] = {}
    for run in runs:
        manifest = read_manifest(find_run(run))
        name, given = str(manifest["name"]), list(manifest.get("overrides", []))
        if name not in loaded.experiments:
            known = ", ".join(loaded.experiments)
            message = f"is a run of '{name}', which is not part of this study{nearest(name, loaded.experiments)}"
            raise ExperimentError(f"--from {run}: {message} (known: {known})")
        if (run / "experiment.yaml").read_bytes() != loaded.sources[name].read_bytes():
            raise ExperimentError(f"--from {run}: {loaded.sources[name]} has been changed since; run it again")
        if given != list(overrides):
            was, now = (", ".join(texts) or "none" for texts in (given, overrides))
            raise ExperimentError(f"--from {run}: was run with other overrides ({was}; asked for now: {now})")
        if name in found:
            raise ExperimentError(f"--from {run}: {found[name]} is a run of '{name}' already; give one")
        found[name] = run
    return found
