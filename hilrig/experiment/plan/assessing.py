"""Assesses which bounds the plan keeps, for the task and every controller that can tell; used by check and report."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hilrig.core.assessment import Assessing, Assessment, Bound, Setting
from hilrig.core.errors import ExperimentError, HilrigError, PluginError, Problem
from hilrig.experiment.plan.free_flight import assess_free_flight
from hilrig.experiment.plan.path import tip_paths
from hilrig.experiment.trial import Trial, make_task
from hilrig.kinds.user_files import code_of, place_of

if TYPE_CHECKING:
    from hilrig.experiment import Experiment


class PlanAssessment(NamedTuple):
    """What is known about a plan before it is run."""

    controllers: Mapping[str, Assessment]
    """By name, for those that offer `assess`"""
    task: Assessment

    def document(self) -> dict[str, Any]:
        """Return it as plain data for JSON."""
        controllers = {name: assessment.document() for name, assessment in self.controllers.items()}
        return {"controllers": controllers, "task": self.task.document()}


def assess(experiment: Experiment, trials: Sequence[Trial]) -> PlanAssessment:
    """Return which bounds the trials of an experiment's plan keep, at the worst place over all conditions.

    Raises ExperimentError if a controller's `assess` fails or does not return an assessment, and PluginError if a
    user's robot fails along the path.
    """
    with code_of():
        setting = setting_of(trials)
        task = assess_free_flight(trials[0], setting)
    controllers = {trial.controller_name: trial.controller for trial in trials}
    found, problems = {}, []
    for name, controller in controllers.items():
        if not isinstance(controller, Assessing):
            continue
        try:
            with code_of(controller):
                found[name] = _checked(controller.assess(setting), controller)
        except HilrigError as error:
            problems.append(Problem(experiment.place("controllers", name), f"controller '{name}': {error}"))
    if problems:
        raise ExperimentError(problems)
    return PlanAssessment(found, task)


def setting_of(trials: Sequence[Trial]) -> Setting:
    """Return what the trials of a plan have in common: loop, task, and the paths of all conditions."""
    first = trials[0]
    paths = tip_paths([trial for trial in trials if trial.repeat == first.repeat])
    limits = first.limits
    return _read_only(
        Setting(make_task(first), first.velocity_smoothing, limits.joint_velocity, limits.tip_force, paths)
    )


def _read_only(value: Any) -> Any:
    """Return the same value with read-only views of its arrays, so that all controllers receive the same."""
    if isinstance(value, np.ndarray):
        view = value.view()
        view.flags.writeable = False
        return view
    if isinstance(value, tuple):
        items = [_read_only(item) for item in value]
        return type(value)(*items) if hasattr(value, "_fields") else tuple(items)
    return value


def _checked(found: Any, controller: Assessing) -> Assessment:
    """Return a controller's assessment, checked. Raises PluginError, naming the line of its `assess`."""
    try:
        return accepted(found)
    except NotAnAssessmentError as error:
        code = getattr(inspect.unwrap(type(controller).assess), "__code__", None)
        where = f"{code.co_filename}:{code.co_firstlineno}" if code else place_of(type(controller))
        raise PluginError(f"{where}: assess: {error}") from error


class NotAnAssessmentError(Exception):
    """A controller's `assess` returned something else; the message says what is wrong with it."""


def accepted(found: Any) -> Assessment:
    """Return the assessment with plain data. Raises NotAnAssessmentError."""
    if not isinstance(found, Assessment):
        raise NotAnAssessmentError(f"it must return an Assessment, not {_shown(found)}")
    for name, kind in (("bounds", Bound), ("unknown", str)):
        items = getattr(found, name)
        if not isinstance(items, (tuple, list)):
            raise NotAnAssessmentError(f"'{name}' must be a tuple, not {_shown(items)}")
        for item in items:
            if not isinstance(item, kind):
                raise NotAnAssessmentError(f"'{name}' must hold {kind.__name__}, not {_shown(item)}")
    if not isinstance(found.note, str):
        raise NotAnAssessmentError(f"'note' must be text, not {_shown(found.note)}")
    return Assessment(tuple(_checked_bound(bound) for bound in found.bounds), tuple(found.unknown), found.note)


def _checked_bound(bound: Bound) -> Bound:
    """Return the bound with plain floats. Raises NotAnAssessmentError."""
    who = f"bound '{bound.name}'"
    for name in ("name", "unit", "warning", "where", "basis"):
        if not isinstance(text := getattr(bound, name), str):
            raise NotAnAssessmentError(f"{who}: '{name}' must be text, not {_shown(text)}")
    if bound.must not in ("below", "above"):
        raise NotAnAssessmentError(f"{who}: 'must' is {_shown(bound.must)}; it must be 'below' or 'above'")
    if bound.recorded_as not in ("", "command_age"):
        raise NotAnAssessmentError(
            f"{who}: 'recorded_as' is {_shown(bound.recorded_as)}; it must be 'command_age' or ''"
        )
    if bound.recorded_as == "command_age" and bound.unit != "s":
        raise NotAnAssessmentError(f"{who}: 'unit' is {_shown(bound.unit)}; a command_age is recorded in 's'")
    if not isinstance(bound.about, (tuple, list)) or not all(isinstance(key, (str, int)) for key in bound.about):
        raise NotAnAssessmentError(f"{who}: 'about' must be keys, such as ('gain',), not {_shown(bound.about)}")
    value, limit = (_number(who, name, getattr(bound, name)) for name in ("value", "limit"))
    return bound._replace(value=value, limit=limit, about=tuple(bound.about))


def _number(who: str, name: str, value: Any) -> float:
    """Return a number of a bound, which may be infinite. Raises NotAnAssessmentError."""
    array = np.asarray(value if isinstance(value, (int, float, np.ndarray, np.generic)) else None)
    if array.dtype.kind not in "iuf" or array.size != 1:
        raise NotAnAssessmentError(f"{who}: '{name}' must be one number, not {_shown(value)}")
    if np.isnan(array).any():
        raise NotAnAssessmentError(f"{who}: '{name}' is not a number (nan)")
    return float(array.reshape(()))


def _shown(value: Any) -> str:
    """Return a value in a few words; for an array, its shape."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
