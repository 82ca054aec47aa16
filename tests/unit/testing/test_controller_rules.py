"""Laws that each break one rule, as their authors would by mistake: the suite notices, and says so in a sentence."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers.rules import assert_noticed, assert_the_first_rule_alone, broken, changed

GOOD = '''
"""A law of somebody's own."""
import time
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple
import numpy as np
from hilrig import Law, Parameter, PerAxis, advance_filter, per_axis

class Memory(NamedTuple):
    filter_position: np.ndarray
    filter_velocity: np.ndarray
    integral: np.ndarray

SHARED = []

@dataclass(frozen=True)
class Mine:
    """tau = J^T (K (p_d - x) + I integral(p_d - x))"""

    gain: Annotated[PerAxis, Parameter("N/m", "K", 0, 1e5, "log")] = 800.0
    # field

    def start(self, task, state):
        p, v, integral = state.position.copy(), state.velocity.copy(), np.zeros(len(task.axes))
        gain = self.per_axis(len(task.axes))
        # start
        return Law(self.step, (task, gain), Memory(p, v, integral))

    def per_axis(self, size):
        return per_axis(self.gain, size, "gain")

    # method

    def step(self, parameters, memory, state, reference):
        # first
        task, gain = parameters
        advance_filter(task.impedance, state.elapsed, *memory[:2], state, reference)
        error = memory.filter_position - state.position
        # early
        memory.integral[:] += state.elapsed * error
        torque = state.jacobian.T @ (gain * error + 100.0 * memory.integral)
        # late
        return torque
'''
FAULTS = {
    "the_law_starts_and_its_step_runs": (
        {"start": "return self.step, (task, gain), Memory(p, v, integral)"}, "`start` returned a tuple",
    ),
    "dimensions_come_from_the_task": (
        {"start": "integral = np.zeros(2)"}, "but on one axis it raised ValueError: ",
    ),
    "torque_is_one_finite_number_for_each_joint": ({"late": "return torque[:1]"}, "an array (1,) instead of (2,)"),
    "torque_is_one_finite_number_for_each_joint list": ({"late": "return list(torque)"}, "it returned a list"),
    "torque_is_one_finite_number_for_each_joint integers": (
        {"late": "return torque.astype(np.float32)"}, "an array of float32",
    ),
    "torque_is_one_finite_number_for_each_joint finite": ({"late": "torque[0] = np.nan"}, "at tick 0 it returned [nan"),
    "memory_can_be_recorded": ({"start": "integral = 0.0"}, "memory field 'integral' is a float"),
    "memory_can_be_recorded single": (
        {"start": "integral = integral.astype(np.float32)"}, "every field must be an array of float64",
    ),
    "memory_fields_are_arrays_of_their_own": ({"start": "p = integral"}, "'integral' are one array"),
    "memory_fields_are_arrays_of_their_own state": (
        {"start": "p = state.position"}, "'filter_position' is the array state.position itself; copy it",
    ),
    "memory_fields_are_arrays_of_their_own shared": (
        {"start": "SHARED.append(integral); integral = SHARED[0]"}, "two laws have the same array 'integral'",
    ),
    "memory_is_written_in_place": (
        {"first": "memory = Memory(*(part.copy() for part in memory))"},
        "all of it is unchanged",
    ),
    "memory_is_written_in_place slip": (
        {"early": "memory.integral += state.elapsed * error"},
        "write into the array of the NamedTuple: `memory.integral[:] += state.elapsed * error` (line 39)",
    ),
    "memory_is_all_that_a_law_remembers": (
        {"early": "SHARED.append(1.0); error = error + 1e-6 * len(SHARED)"},
        "a new law with the memory of another gave",
    ),
    "memory_is_all_that_a_law_remembers parameters": (
        {"early": "gain *= 1.001"}, "a new law with the memory of another gave",
    ),
    "start_only_reads_what_it_is_given": ({"start": "state.torque[:] = 0.0"}, "it changed state.torque at tick 0"),
    "start_only_reads_what_it_is_given task": (
        {"start": "task.torque_limit[:] *= 0.9"},
        "it changed task.torque_limit at tick 0 from [100, 100] to [90, 90]",
    ),
    "step_only_reads_what_it_is_given": (
        {"late": "wanted = reference.force; wanted -= state.force"}, "it changed reference.force at tick ",
    ),
    "step_only_reads_what_it_is_given state": (
        {"late": "state.position.sort()"}, "it changed state.position at tick ",
    ),
    "step_only_reads_what_it_is_given impedance": (
        {"late": "task.impedance.damping[0] += 1.0"}, "it changed task.impedance.damping at tick 0 from [30, 30]",
    ),
    "a_law_copies_what_it_keeps": (
        {"start": "self.__dict__['last'] = state.position",
         "late": "torque[0] += (state.position - self.last)[0]; self.__dict__['last'] = state.position"},
        "in arrays used before, it gave",
    ),
    "a_law_copies_what_it_keeps jacobian": (
        {"start": "gain = (gain, state.jacobian)", "early": "gain, first = gain; error = first @ error"},
        "in arrays used before, it gave",
    ),
    "the_same_run_twice_gives_the_same_bits": (
        {"late": "torque = torque + np.random.normal(size=torque.size)"}, "in the second run",
    ),
    "the_same_run_twice_gives_the_same_bits clock": (
        {"late": "torque = torque + 1e-9 * time.perf_counter()"}, "in the second run",
    ),
    "two_laws_share_nothing": (
        {"start": "self.__dict__['sum'] = 0.0", "early": "self.__dict__['sum'] += error[0]; error = error + self.sum"},
        "with another law at work, it gave",
    ),
    "a_wrong_number_of_values_is_refused_by_name": (
        {"method": "def per_axis(self, size): return np.resize(self.gain, size).astype(float)"},
        "three values of 'gain' were taken for two axes",
    ),
    "without_a_model_it_works_or_refuses": (
        {"start": "assert task.dynamic_parameters.size"}, "it raised AssertionError (line 26)",
    ),
    "parameters_can_be_searched": (
        {"field": "other: Annotated[float, Parameter('s', 'T', 0)] = 1.0"}, "those of 'other' are 0 and inf",
    ),
}  # fmt: skip


def test_a_good_law_keeps_every_rule(tmp_path: Path) -> None:
    assert broken("controllers", GOOD, tmp_path) == {}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_noticed_and_told(tmp_path: Path, fault: str) -> None:
    replacements, words = FAULTS[fault]
    assert_noticed("controllers", changed(GOOD, **replacements), tmp_path, fault.split()[0], words)


def test_a_law_for_two_axes_may_refuse_others(tmp_path: Path) -> None:
    refusal = "if len(task.axes) != 2: raise ValueError('two axes, please')"
    assert broken("controllers", changed(GOOD, start=refusal), tmp_path) == {}


def test_every_choice_is_looked_at_and_named(tmp_path: Path) -> None:
    source = changed(
        GOOD.replace("NamedTuple\n", "NamedTuple, Literal\n", 1),
        field="mode: Literal['right', 'wrong'] = 'right'",
        late="return torque[: 1 if self.mode == 'wrong' else 2]",
    )
    sentences = broken("controllers", source, tmp_path)
    assert sentences["torque_is_one_finite_number_for_each_joint"] == (
        "mine.py with mode='wrong': `step` must return an array with one finite torque for each joint, at every tick, "
        "but at tick 0 it returned an array (1,) instead of (2,)"
    )


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("start", "mine.py: `start` must return a Law of step, parameters and memory, and its `step` must run, "
                  "but in `start` it raised ZeroDivisionError: division by zero (line 26)"),
        ("early", "but in `step`, at tick 0, it raised ZeroDivisionError: division by zero (line 39)"),
    ],
)  # fmt: skip
def test_an_exception_is_told_once(tmp_path: Path, place: str, words: str) -> None:
    source = changed(GOOD, **{place: "1 / 0"})
    assert_the_first_rule_alone("controllers", source, tmp_path, "the_law_starts_and_its_step_runs", words)
