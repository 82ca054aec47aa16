"""Reading an experiment file."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from hilrig.core.errors import ExperimentError, Place, Problem
from hilrig.core.quantities import shortened, shown
from hilrig.experiment import document
from hilrig.experiment.crosscheck import cross_checked
from hilrig.experiment.document import Document, Keys
from hilrig.experiment.model import Experiment
from hilrig.experiment.overrides import override
from hilrig.experiment.schema import Context, InvalidError, SchemaFinding, json_schema, read_record

STUDY_KEYS = ("claims", "experiments")
EXPERIMENT_KEYS = ("driver", "task", "phases", "controllers")
"""Keys that only one of the two has; they tell studies and experiments apart"""


def load(path: Path, overrides: Iterable[str] = ()) -> Experiment:
    """Return the experiment in a file, with overrides such as "controllers.pd.stiffness=100 N/m".

    Raises ExperimentError with all problems, each with its place.
    """
    source = document.read_document(Path(path))
    if is_study(source):
        message = f"this is a study, not an experiment; type: hilrig reproduce {shlex.quote(str(path))}"
        raise ExperimentError([Problem(Place(str(path)), message)])
    for text in overrides:
        source = override(source, text)
    try:
        experiment = read_record(Experiment, source.data, Context(Path(path).resolve().parent))
        return replace(cross_checked(experiment), source=source)
    except InvalidError as error:
        raise ExperimentError(problems(error.findings, source)) from error


def is_study(source: Document) -> bool:
    """Return whether a file is a study, judged by its keys."""
    return not source.data.keys().isdisjoint(STUDY_KEYS) and source.data.keys().isdisjoint(EXPERIMENT_KEYS)


def is_experiment(source: Document) -> bool:
    """Return whether a file is an experiment, judged by its keys."""
    return not source.data.keys().isdisjoint(EXPERIMENT_KEYS) and source.data.keys().isdisjoint(STUDY_KEYS)


def experiment_schema() -> dict[str, Any]:
    """Return the JSON Schema of experiment files, with every kind that is installed."""
    return json_schema(Experiment)


def problems(findings: Iterable[SchemaFinding], source: Document) -> list[Problem]:
    """Return the findings as problems, each with its place, in file order."""
    problems = [Problem(source.place(*found.path, key=found.on_key), _as_written(found, source)) for found in findings]
    return sorted(problems, key=lambda problem: (problem.place or Place("", 0, 0))[1:])


def _as_written(found: SchemaFinding, source: Document) -> str:
    """Return the message with the value as written in the file: 1e-3, not 0.001."""
    value, written = _at(source.data, found.path), source.written.get(found.path)
    if written is None or isinstance(value, (str, bool)) or value is None or shortened(written) != written:
        return found.message
    return found.message.replace(shown(value), written, 1)


def _at(data: Any, path: Keys) -> Any:
    for key in path:
        try:
            data = data[key]
        except (KeyError, IndexError, TypeError):
            return None
    return data
