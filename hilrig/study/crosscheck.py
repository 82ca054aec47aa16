"""Checks whether the figures and claims of a study fit its experiments."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from hilrig.core.errors import nearest
from hilrig.core.quantities import quantity, shown
from hilrig.experiment import Experiment
from hilrig.experiment.document import Keys
from hilrig.experiment.schema import InvalidError, SchemaFinding
from hilrig.experiment.trial import ALL_PHASES
from hilrig.kinds import registry as plugins
from hilrig.report.internals import memory_documents
from hilrig.report.plotted import QUANTITIES
from hilrig.study.measuring import MEMORY_PREFIX, memory_field
from hilrig.study.model import WAYS, Claim, EqualsWithin, FigureSpec, LessThan, Part, Study

Experiments = Mapping[str, Experiment]

_FIGURE = re.compile(r"[0-9]{1,3}[a-z]?")


def cross_checked_study(study: Study, experiments: Experiments) -> Study:
    """Return the study with every limit in its metric's unit.

    Raises InvalidError with everything that does not match.
    """
    findings: list[SchemaFinding] = []
    for i, figure in enumerate(study.figures):
        findings += _check_figure(figure, study, i, experiments)
    claims = [_completed_claim(claim, ("claims", i), experiments, findings) for i, claim in enumerate(study.claims)]
    if findings:
        raise InvalidError(findings)
    return replace(study, claims=tuple(claims))


def _known(what: str, value: str | None, known: Any, path: Keys) -> Iterator[SchemaFinding]:
    """Yield a finding if `value` is given and not among the known names."""
    if value is not None and value not in known:
        listed = ", ".join(known) or "none"
        yield SchemaFinding(path, f"there is no {what} '{value}'{nearest(value, known)} (known: {listed})")


def _check_figure(figure: FigureSpec, study: Study, index: int, experiments: Experiments) -> Iterator[SchemaFinding]:
    path: Keys = ("figures", index)
    if not _FIGURE.fullmatch(figure.figure):
        yield SchemaFinding((*path, "figure"), f"{shown(figure.figure)} is not a figure number such as '4' or '12b'")
    if figure.figure in [other.figure for other in study.figures[:index]]:
        yield SchemaFinding((*path, "figure"), f"figure '{figure.figure}' is defined twice")
    if figure.experiment not in experiments:
        yield from _known("experiment", figure.experiment, experiments, (*path, "experiment"))
        return
    experiment = experiments[figure.experiment]
    yield from _known("condition", figure.condition, experiment.conditions, (*path, "condition"))
    for i, name in enumerate(figure.controllers):
        yield from _known("controller", name, experiment.controllers, (*path, "controllers", i))
    if not figure.controllers:
        yield SchemaFinding((*path, "controllers"), "there are no controllers; a figure needs at least one")
    elif len(figure.controllers) > 1 and figure.axis is None:
        yield SchemaFinding(path, "'axis' is missing: a figure of several controllers shows one axis")
    if figure.zoom and figure.zoom[0] >= figure.zoom[1]:
        yield SchemaFinding((*path, "zoom"), "the interval ends before it begins; write [from, to]")
    yield from _check_quantity(figure, experiment, path)


def _check_quantity(figure: FigureSpec, experiment: Experiment, path: Keys) -> Iterator[SchemaFinding]:
    prefix, dot, field = figure.quantity.partition(".")
    if dot and prefix == "memory":
        for name in figure.controllers:
            yield from _check_field(field, experiment, name, (*path, "quantity"))
        return
    yield from _known("quantity", figure.quantity, [*QUANTITIES, "memory.<field>"], (*path, "quantity"))
    yield from _known("axis", figure.axis, _axes(figure.quantity, experiment), (*path, "axis"))


def _axes(quantity_name: str, experiment: Experiment) -> list[str]:
    """Return the axes that a quantity or metric of this name has."""
    axes, force = experiment.driver.robot.axes, experiment.task.force_axes
    if quantity_name.startswith("force"):
        return [axis for axis in axes if axis in force]
    if quantity_name.startswith("position"):
        return [axis for axis in axes if axis not in force]
    return list(axes)


def _check_field(field: str, experiment: Experiment, controller: str, path: Keys) -> Iterator[SchemaFinding]:
    """Yield a finding if it is known that a law's memory has no such field."""
    law = experiment.controllers.get(controller)
    fields = memory_documents(plugins.name_of(type(law))[1]) if law else {}
    if fields:
        yield from _known("field", field, fields, path)


def _completed_claim(claim: Claim, path: Keys, experiments: Experiments, findings: list[SchemaFinding]) -> Claim:
    if bool(claim.parts) == bool(claim.undecided):
        findings.append(
            SchemaFinding(
                path, "a claim needs either 'parts' to measure, or 'undecided' with the reason why it cannot be decided"
            )
        )
    parts = []
    for i, part in enumerate(claim.parts):
        findings += _check_part(part, (*path, "parts", i), experiments)
        parts.append(_in_unit(part, (*path, "parts", i), findings))
    return replace(claim, parts=tuple(parts))


def _check_part(part: Part, path: Keys, experiments: Experiments) -> Iterator[SchemaFinding]:
    given = [way for way in WAYS if getattr(part, way) is not None]
    if len(given) != 1:
        named = " and ".join(f"'{way}'" for way in given)
        found = f"{named} are {'both' if len(given) == 2 else 'all'} given" if given else "nothing is claimed"
        yield SchemaFinding(path, f"{found}; give exactly one of {', '.join(WAYS)}")
    yield from _check_place(part, path, experiments)
    other = part.less_than or part.equals_within
    if other is not None:
        where = (*path, "less_than" if part.less_than else "equals_within")
        there = elsewhere(part, other)
        if there == part:
            yield SchemaFinding(
                where, "this compares a value with itself; name another controller, experiment, condition or phase"
            )
        yield from _check_place(there, where, experiments)
    yield from _check_metric(part, path, experiments)


def elsewhere(part: Part, other: LessThan | EqualsWithin) -> Part:
    """Return the part for the other value; everything that `other` does not name is as in `part`."""
    names = ("experiment", "condition", "controller", "phase")
    return replace(part, **{name: value for name in names if (value := getattr(other, name)) is not None})


def _check_place(part: Part, path: Keys, experiments: Experiments) -> Iterator[SchemaFinding]:
    """Yield a finding for each unknown experiment, condition, controller and phase of a value."""
    if part.experiment not in experiments:
        yield from _known("experiment", part.experiment, experiments, (*path, "experiment"))
        return
    experiment = experiments[part.experiment]
    phases = [*(phase.name for phase in experiment.phases), ALL_PHASES]
    choices = {"condition": experiment.conditions, "controller": experiment.controllers, "phase": phases}
    for name, known in choices.items():
        yield from _known(name, getattr(part, name), known, (*path, name))


def _check_metric(part: Part, path: Keys, experiments: Experiments) -> Iterator[SchemaFinding]:
    experiment = experiments.get(part.experiment)
    if experiment is None:
        return
    field = memory_field(part.metric)
    if field is not None:
        yield from _check_field(field, experiment, part.controller, (*path, "metric"))
        if not part.axis:
            yield SchemaFinding(path, "'axis' is missing: an axis, or the number of a component from 1")
        return
    kinds = plugins.kind_names("metrics")
    yield from _known(
        "metric", part.metric, [*kinds, *(f"{name}.<field>" for name in MEMORY_PREFIX)], (*path, "metric")
    )
    if part.axis:
        yield from _known("axis", part.axis, _axes(part.metric, experiment), (*path, "axis"))


def _in_unit(part: Part, path: Keys, findings: list[SchemaFinding]) -> Part:
    """Return the part with its limits in its metric's unit; limits that cannot be converted are added to `findings`."""
    plain = memory_field(part.metric) is not None
    if not plain and part.metric not in plugins.kind_names("metrics"):
        return part
    unit = "" if plain else plugins.load_kind("metrics", part.metric).unit
    for name in ("below", "above"):
        value = getattr(part, name)
        if value is not None:
            try:
                part = replace(part, **{name: quantity(value, unit)})
            except ValueError as error:
                findings.append(SchemaFinding((*path, name), str(error)))
    return part
