"""The warnings for an experiment: each bound that it does not keep, with the place in its file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from hilrig.core.assessment import Assessment
from hilrig.core.errors import Problem
from hilrig.experiment.document import Keys
from hilrig.experiment.plan.assessing import PlanAssessment
from hilrig.experiment.plan.reference_warnings import of_references
from hilrig.kinds.registry import load_kinds

if TYPE_CHECKING:
    from hilrig.experiment import Experiment


def warnings(experiment: Experiment, found: PlanAssessment) -> list[Problem]:
    """Return a warning for every bound that should be kept but is not, and for what cannot be judged.

    The experiment runs anyway.
    """
    spoken = [*of_references(experiment), *_of_controllers(found), *_of_one(found.task)]
    return [*_of_metrics(), *(Problem(experiment.place(*path), message) for path, message in spoken)]


def _of_metrics() -> Iterator[Problem]:
    """Yield a warning for each installed metric that no report can show."""
    for kind, reason in load_kinds("metrics")[1].items():
        yield Problem(None, f"the metric '{kind}' is left out of the report: {reason}")


def _of_controllers(found: PlanAssessment) -> Iterator[tuple[Keys, str]]:
    """Yield each warning once, at the first controller it applies to."""
    names: dict[tuple[Keys, str], list[str]] = {}
    for name, assessment in found.controllers.items():
        for warning in _of_one(assessment):
            names.setdefault(warning, []).append(name)
    for (below, text), mine in names.items():
        who = "controller" if len(mine) == 1 else "controllers"
        listed = ", ".join(f"'{name}'" for name in mine)
        yield ("controllers", mine[0], *below), f"{who} {listed}: {text}"


def _of_one(assessment: Assessment) -> Iterator[tuple[Keys, str]]:
    for bound in assessment.bounds:
        if bound.warning and not bound.kept:
            yield bound.about, bound.warning
    for reason in assessment.unknown:
        yield (), reason
