"""Laws whose `assess` breaks one rule each."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers.rules import assert_noticed, broken, changed

GOOD = '''
"""A law of somebody's own that knows a bound."""
from dataclasses import dataclass
from typing import Annotated
import numpy as np
from hilrig import Assessment, Bound, Law, Parameter

CALLS = []

@dataclass(frozen=True)
class Mine:
    """tau = J^T (F_d - D x')"""

    damping: Annotated[float, Parameter("N*s/m", "D", 0, 1e4, "log")] = 50.0

    def start(self, task, state):
        # start
        return Law(self.step, None, ())

    def step(self, parameters, memory, state, reference):
        return state.jacobian.T @ (reference.force - self.damping * state.velocity)

    def assess(self, setting):
        bounds, unknown = [], []
        # assess
        for path in setting.paths:
            if path.mobility is None:
                unknown.append("the rate is not known: the robot has no model")
                continue
            rate = self.damping * path.mobility[:, 0, 0].max() * setting.task.period
            bounds.append(Bound("rate", rate, "below", 1.0, "", "too fast", path.places[0]))
        # last
        return Assessment(tuple(bounds), tuple(unknown))
'''
FAULTS = {
    "assess_returns_an_assessment": ({"last": "return bounds"}, "it must return an Assessment, not [Bound("),
    "assess_returns_an_assessment bound": (
        {"last": "bounds[0] = bounds[0]._replace(must='under')"}, "'must' is 'under'; it must be 'below' or 'above'",
    ),
    "assess_returns_an_assessment nan": (
        {"last": "bounds[0] = bounds[0]._replace(value=np.nan)"}, "bound 'rate': 'value' is not a number (nan)",
    ),
    "assess_returns_an_assessment raises": ({"assess": "1 / 0"}, "it raised ZeroDivisionError: "),
    "assess_gives_the_same_answer_twice": (
        {"last": "CALLS.append(1); bounds[0] = bounds[0]._replace(limit=float(len(CALLS)))"},
        "`limit` of 'rate' was 1.0 at first and 2.0 the second time",
    ),
    "assess_gives_the_same_answer_twice random": (
        {"last": "bounds[0] = bounds[0]._replace(value=np.random.random())"}, "`value` of 'rate' was 0.417",
    ),
    "assess_gives_the_same_answer_twice fewer": (
        {"last": "CALLS.append(1); bounds = bounds[: len(CALLS)]"}, "the second answer was another one",
    ),
    "assess_only_reads_the_setting": (
        {"assess": "setting.paths[1].reference.position.sort(axis=0)"}, "it changed paths[1].reference.position",
    ),
    "assess_only_reads_the_setting task": (
        {"assess": "setting.task.impedance.damping[:] = 0"}, "it changed task.impedance.damping",
    ),
    "assess_copes_without_a_model": (
        {"assess": "setting.paths[0].mobility[0]"},
        "without a model it raised TypeError: 'NoneType' object is not subscriptable (line ",
    ),
}  # fmt: skip


def test_a_good_law_keeps_every_rule(tmp_path: Path) -> None:
    assert broken("controllers", GOOD, tmp_path) == {}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_noticed_and_told(tmp_path: Path, fault: str) -> None:
    replacements, words = FAULTS[fault]
    assert_noticed("controllers", changed(GOOD, **replacements), tmp_path, fault.split()[0], words)


def test_a_law_that_refuses_a_robot_without_a_model_is_not_asked_to_assess_it(tmp_path: Path) -> None:
    refusal = "if not task.dynamic_parameters.size: raise ValueError('it needs a model')"
    source = changed(GOOD, start=refusal, assess="setting.paths[0].mobility[0]")
    assert broken("controllers", source, tmp_path) == {}
