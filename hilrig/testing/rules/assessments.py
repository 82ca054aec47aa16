"""What controllers keep that offer `assess`: its answer depends on the controller and the Setting alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from hilrig import Array, Assessment, Controller
from hilrig.core.assessment import Assessing, Setting
from hilrig.experiment.plan.assessing import NotAnAssessmentError, accepted
from hilrig.testing.rule import Broken, NotApplicableError, noting, require, rule, same
from hilrig.testing.rules.controllers import fitting
from hilrig.testing.scenario import arrays, setting


@rule("controllers")
def assess_returns_an_assessment(controller: Controller) -> None:
    """`assess`, where it is offered, must return an Assessment that `hilrig check` accepts."""
    _assessed(controller, _setting(controller))


@rule("controllers")
def assess_gives_the_same_answer_twice(controller: Controller) -> None:
    """`assess` must give the same answer whenever it is called: `hilrig check`, a run and the report call it.

    NumPy's global generator is in another state at each call.
    """
    answers: list[Assessment] = []
    for seed in (1, 2):
        np.random.seed(seed)
        answers.append(_assessed(controller, _setting(controller)))
    first, second = answers
    for one, two in zip(first.bounds, second.bounds, strict=False):
        for name, there, then in zip(one._fields, one, two, strict=True):
            require(there == then, f"`{name}` of '{one.name}' was {there!r} at first and {then!r} the second time")
    require(first == second, "the second answer was another one")


@rule("controllers")
def assess_only_reads_the_setting(controller: Controller) -> None:
    """`assess` must only read the Setting: the other controllers are given the same one."""
    given, untouched = _setting(controller), _named(_setting(controller))
    _assessed(controller, given)
    for name, array in _named(given).items():
        require(same(array, untouched[name]), f"it changed {name}")


@rule("controllers")
def assess_copes_without_a_model(controller: Controller) -> None:
    """`assess` must return an Assessment also for a robot without a model, where the mobility of a path is None.

    What cannot be judged then is an entry of `unknown`.
    """
    without = _setting(controller, model=False)
    given = fitting(controller)
    try:
        controller.start(without.task, given.ticks[0].state._replace(regressor=given.ticks[0].state.regressor[..., :0]))
    except ValueError:
        return  # it refuses such a robot
    with noting("without a model"):
        _assessed(controller, without)


def _setting(controller: Controller, model: bool = True) -> Setting:
    """Return a new setting on as many axes as the controller takes."""
    return setting(len(fitting(controller).task.axes), model)


def _assessed(controller: Controller, given: Setting) -> Assessment:
    """Return a controller's assessment. Raises Broken if it is none, and NotApplicableError if there is no `assess`."""
    if not isinstance(controller, Assessing):
        raise NotApplicableError("it offers no `assess`")
    try:
        return accepted(controller.assess(given))
    except NotAnAssessmentError as error:
        raise Broken(str(error)) from error


def _named(given: Setting) -> dict[str, Array]:
    """Return every array of a setting by name."""
    parts: dict[str, Any] = {"task": given.task, "task.impedance": given.task.impedance}
    for i, path in enumerate(given.paths):
        parts |= {f"paths[{i}]": path, f"paths[{i}].reference": path.reference}
    return {f"{where}.{name}": array for where, part in parts.items() for name, array in arrays(part)}
