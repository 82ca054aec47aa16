"""Reads a study's file and the experiments that it names."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from hilrig.core.errors import ExperimentError, Place, Problem, nearest
from hilrig.experiment import Experiment, document, load
from hilrig.experiment.loading import is_experiment, problems
from hilrig.experiment.schema import Context, InvalidError, read_record
from hilrig.study.crosscheck import cross_checked_study
from hilrig.study.model import Study


@dataclass(frozen=True)
class Loaded:
    """A study that has been checked against its experiments."""

    path: Path
    study: Study
    experiments: dict[str, Experiment]
    """By name, in file order"""
    sources: dict[str, Path]
    """The file of each experiment, by the experiment's name"""


def load_study(path: Path, overrides: Iterable[str] = ()) -> Loaded:
    """Return the study in a file, with its experiments; `overrides` such as "repeats=2" change all of them.

    Raises ExperimentError with everything that is wrong, each with its place.
    """
    source = document.read_document(path)
    if is_experiment(source):
        message = f"this is an experiment, not a study; to run it: hilrig run {shlex.quote(str(path))}"
        raise ExperimentError([Problem(Place(str(path)), message)])
    try:
        study = read_record(Study, source.data, Context(path.resolve().parent))
    except InvalidError as error:
        raise ExperimentError(problems(error.findings, source)) from error
    experiments, sources = _experiments(study, source, list(overrides))
    try:
        return Loaded(path, cross_checked_study(study, experiments), experiments, sources)
    except InvalidError as error:
        raise ExperimentError(problems(error.findings, source)) from error


def _experiments(
    study: Study, source: document.Document, overrides: list[str]
) -> tuple[dict[str, Experiment], dict[str, Path]]:
    """Return the experiments and their files, by name. Raises ExperimentError with all mistakes in them."""
    experiments: dict[str, Experiment] = {}
    sources: dict[str, Path] = {}
    found: list[Problem] = []
    for i, name in enumerate(study.experiments):
        file = Path(source.file).parent / name
        if not file.is_file():
            beside = [item.name for item in file.parent.glob("*.y*ml")]
            message = f"there is no file '{name}' in the folder of this one{nearest(name, beside)}"
            found.append(Problem(source.place("experiments", i), message))
            continue
        try:
            experiment = load(file, overrides)
        except ExperimentError as error:
            found += error.problems
            continue
        if experiment.name in experiments:
            message = f"the experiment '{experiment.name}' is listed twice, also in {sources[experiment.name].name}"
            found.append(Problem(source.place("experiments", i), message))
        experiments[experiment.name], sources[experiment.name] = experiment, file
    if not study.experiments:
        found.append(Problem(source.place("experiments"), "there are no experiments; a study needs at least one"))
    if found:
        raise ExperimentError(dict.fromkeys(found))
    return experiments, sources
