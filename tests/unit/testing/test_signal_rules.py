"""References, disturbances and metrics that each break one rule."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from helpers.rules import assert_noticed, assert_the_first_rule_alone, broken, changed

REFERENCE = '''
"""A reference of somebody's own."""
from dataclasses import dataclass
from typing import Annotated
import numpy as np
from hilrig import Parameter, Samples

@dataclass(frozen=True)
class Mine:
    """r(t) = amplitude sin(w t) with a corner where it is zero"""

    amplitude: Annotated[float, Parameter("m|N", "of the swing", 0.0, 10.0)]
    # field

    def sample(self, time, span):
        w = 2.0
        value, rate = np.abs(self.amplitude * np.sin(w * time)), w * self.amplitude * np.cos(w * time)
        rate = rate * np.sign(np.sin(w * time))
        acceleration = -w * w * value
        # sample
        return Samples(value, rate, acceleration)
'''
REFERENCE_FAULTS = {
    "samples_are_three_finite_arrays": ("rate = rate.mean()", "its rate is a float64"),
    "samples_are_three_finite_arrays list": ("value = list(value)", "its value is a list"),
    "samples_are_three_finite_arrays finite": ("rate[time > 5] = np.nan", "its rate at t = [5."),
    "rates_are_the_derivatives": ("rate = rate * 1.001", "the value changes by "),
    "rates_are_the_derivatives acceleration": ("acceleration = 0 * acceleration", "the rate changes by "),
    "rates_are_the_derivatives steps": ("value = np.round(value, 1)", "s the value changes by "),
    "a_sample_does_not_depend_on_the_others": (
        "rate = np.gradient(value, time) if time.size > 1 else 0 * time", "alone",
    ),
    "times_are_only_read": ("time -= span.start", "it changed them"),
    "samples_belong_to_the_caller": ("acceleration = value", "its value shares its memory with another of the three"),
    "samples_belong_to_the_caller kept": (
        "self.__dict__.setdefault('kept', value); value = self.kept if self.kept.shape == time.shape else value",
        "after a change of its value it gave [9, 9, 9], ... at the next call",
    ),
}  # fmt: skip

DISTURBANCE = '''
"""A disturbance of somebody's own."""
from dataclasses import dataclass
from typing import Annotated, ClassVar
import numpy as np
from hilrig import Parameter

@dataclass(frozen=True)
class Mine:
    """F_e += force (1 + noise) along an axis, for at <= t < until."""

    acts_on: ClassVar[tuple[str, ...]] = ("plant_tip_force",)
    axis: Annotated[str, Parameter("", "along which it acts")]
    force: Annotated[float, Parameter("N", "its size", -10.0, 10.0)] = 2.0
    at: Annotated[float, Parameter("s", "when it begins", 0.0)] = 0.5
    until: Annotated[float, Parameter("s", "when it ends", 0.0)] = 1.5
    # field

    def apply(self, schedule, time, axes, random):
        if self.axis not in axes:
            raise ValueError(f"there is no axis {self.axis!r}")
        column = axes.index(self.axis)
        inside = (time >= self.at - 1e-9) & (time < self.until - 1e-9)
        force = self.force * inside * (1 + 0.1 * random.random(time.size))
        # apply
        schedule.plant_tip_force[:, column] += force
'''
DISTURBANCE_FAULTS = {
    "acts_on_names_fields_of_the_schedule": (
        {"field": "acts_on = ('tip_force',)"}, "it names tip_force (fields: plant_tip",
    ),
    "it_changes_what_it_acts_on_and_nothing_else": (
        {"apply": "schedule.joint_error[:] += 1e-3"}, "changes joint_error, which `acts_on` does not name",
    ),
    "it_changes_what_it_acts_on_and_nothing_else never": (
        {"field": "acts_on = ('plant_tip_force', 'joint_error')"}, "it never changes joint_error",
    ),
    "it_changes_what_it_acts_on_and_nothing_else nothing": (
        {"apply": "force = 0 * force"}, "changes nothing; give the test",
    ),
    "what_it_puts_in_is_finite": ({"apply": "force[700] = np.inf"}, "plant_tip_force is not"),
    "the_same_seed_is_the_same_world": (
        {"apply": "force = force * np.random.random()"}, "was different the second time",
    ),
    "it_adds_to_what_is_there": ({"apply": "schedule.plant_tip_force[:] = 0"}, "plant_tip_force is not what was there"),
    "it_lasts_from_at_to_until": (
        {"apply": "force = np.roll(force, 5)"}, "changed plant_tip_force from 1.005 s to 2.004 s",
    ),
    "it_fits_any_robot_and_any_length": (
        {"apply": "force[500] += 0.0"}, "with 2 joints, 2 axes and 1 ticks it raised IndexError",
    ),
    "times_are_only_read": ({"apply": "time -= self.at"}, "it changed them"),
}  # fmt: skip

METRIC = '''
"""A metric of somebody's own."""
from dataclasses import dataclass
from typing import Annotated, ClassVar
import numpy as np
from hilrig import Parameter

@dataclass(frozen=True)
class Mine:
    """roughness = the mean size of tau's rate, over ticks and joints"""

    unit: ClassVar[str] = "N m/s"
    # field

    def measure(self, record):
        if record.tick.size < 2:
            return {}
        rates = np.abs(np.diff(record.torque, axis=0) / np.diff(record.time)[:, None])
        value = float(np.mean(rates))
        # measure
        return {"": value}
'''
METRIC_FAULTS = {
    "the_unit_is_a_text": ({"field": "unit = None"}, "it is None"),
    "values_are_finite_numbers_by_axis": ({"measure": "value = float('inf')"}, "its value for '' is inf"),
    "values_are_finite_numbers_by_axis axis": (
        {"measure": "return {'joint 1': value}"}, "it returned a value for 'joint 1'; the axes are",
    ),
    "values_are_finite_numbers_by_axis float": ({"measure": "return {'': rates}"}, "is a ndarray, not a float"),
    "values_are_finite_numbers_by_axis dict": ({"measure": "return value"}, "it returned a float, not a dict"),
    "values_are_finite_numbers_by_axis nothing": ({"measure": "return {}"}, "on a whole phase it returned nothing"),
    "lower_is_better": (
        {"measure": "value = 1 / (1 + value)"},
        "without errors, with some and with three times as large ones it gave [1, ",
    ),
    "lower_is_better first below": (
        {"measure": "value = float(np.mean(record.force[:, 1] - record.reference_force[:, 1]))"},
        "for '' on 2 s in which position and force swing about their references, first below them, and come to rest",
    ),
    "lower_is_better first above": (
        {"measure": "value = float(np.mean(record.reference_position[:, 0] - record.position[:, 0]))"},
        "swing about their references, first above them",
    ),
    "lower_is_better same": ({"measure": "value = 1.0"}, "every trial scores {'': 1.0}"),
    "a_record_of_few_ticks_is_no_error": (
        {"measure": "value += record.force[5, 0]"}, "with 3 ticks it raised IndexError",
    ),
    "a_gap_is_not_a_jump": (
        {"measure": "value = float(np.max(np.abs(np.diff(record.torque, axis=0)))) / record.period"},
        "with a gap the value for '' is ",
    ),
    "any_task_can_be_measured": (
        {"measure": "value += abs(record.force[:, 1]).mean()"}, "on one axis it raised IndexError",
    ),
    "any_task_can_be_measured force": (
        {"measure": "value += 0 * record.force[:, list(record.sigma).index(0)].mean()"},
        "with every axis under position control it raised ValueError",
    ),
    "the_record_is_only_read": ({"measure": "record.torque[:] += 1.0"}, "it changed record.torque"),
    "every_parameter_has_a_default": (
        {"field": "band: Annotated[float, Parameter('m', 'width', 0, 1)]"}, "band has none",
    ),
}  # fmt: skip


def test_good_ones_keep_every_rule(tmp_path: Path) -> None:
    for group, source in (("references", REFERENCE), ("disturbances", DISTURBANCE), ("metrics", METRIC)):
        assert broken(group, source, tmp_path) == {}


@pytest.mark.parametrize("fault", REFERENCE_FAULTS)
def test_each_fault_of_a_reference_is_noticed(tmp_path: Path, fault: str) -> None:
    line, words = REFERENCE_FAULTS[fault]
    assert_noticed("references", changed(REFERENCE, sample=line), tmp_path, fault.split()[0], words)


@pytest.mark.parametrize("fault", DISTURBANCE_FAULTS)
def test_each_fault_of_a_disturbance_is_noticed(tmp_path: Path, fault: str) -> None:
    replacements, words = DISTURBANCE_FAULTS[fault]
    assert_noticed("disturbances", changed(DISTURBANCE, **replacements), tmp_path, fault.split()[0], words)


@pytest.mark.parametrize("sign", ["", "-"])
@pytest.mark.parametrize(("signal", "axis"), [("position", 0), ("force", 1)])
def test_a_metric_of_errors_of_one_sign_keeps_every_rule(tmp_path: Path, sign: str, signal: str, axis: int) -> None:
    error = f"{sign}(record.{signal} - record.reference_{signal})[:, {axis} if len(record.axes) > 1 else 0]"
    source = changed(METRIC, measure=f"value = float(np.max({error}))")
    assert broken("metrics", source, tmp_path) == {}


GROWTH = "growth: Annotated[float, Parameter('rad/s^2', 'of the frequency', {bounds})] = 0.0"
CHIRP = (
    "w = w + self.growth * time; value, rate = np.sin(w * time), (w + self.growth * time) * np.cos(w * time)\n"
    "        acceleration = 2 * self.growth * np.cos(w * time) - (w + self.growth * time) ** 2 * np.sin(w * time)"
)


@pytest.mark.parametrize(("bounds", "value"), [("0, 1e3", 1.5), ("0, 0.5", 0.5), ("-3, 0", -1.5)])
def test_a_number_of_a_reference_that_is_zero_is_tested_with_another_value(
    tmp_path: Path, bounds: str, value: float
) -> None:
    right = changed(REFERENCE, field=GROWTH.format(bounds=bounds), sample=CHIRP)
    assert broken("references", right, tmp_path) == {}
    wrong = right.replace("2 * self.growth", "0")
    assert wrong != right
    sentence = broken("references", wrong, tmp_path)["rates_are_the_derivatives"]
    assert sentence.startswith(f"mine.py with growth={value}: The rate must be the derivative"), sentence


def test_a_value_that_does_not_fit_the_others_is_left_out(tmp_path: Path) -> None:
    fields = "until: Annotated[float, Parameter('s', 'end', 0, 9)] = 1.0\n    " + GROWTH.format(bounds="0, 9")
    refusal = "\n    def __post_init__(self):\n        if self.growth > self.until: raise ValueError('too large')"
    source = changed(REFERENCE, field=fields + refusal, sample="assert not self.growth")
    assert broken("references", source, tmp_path) == {}


def test_a_disturbance_that_takes_any_axis_is_noticed(tmp_path: Path) -> None:
    source = DISTURBANCE.replace(
        'raise ValueError(f"there is no axis {self.axis!r}")', "axes = (*axes, self.axis); return"
    )
    rule = "an_axis_that_is_not_there_is_refused"
    assert_noticed("disturbances", source, tmp_path, rule, "it took the axis 'sideways' where there is only x")


@pytest.mark.parametrize("fault", METRIC_FAULTS)
def test_each_fault_of_a_metric_is_noticed(tmp_path: Path, fault: str) -> None:
    replacements, words = METRIC_FAULTS[fault]
    assert_noticed("metrics", changed(METRIC, **replacements), tmp_path, fault.split()[0], words)


GROWING = """
    parts: tuple = ((1.0, 2.0),)

    def __post_init__(self):
        object.__setattr__(self, "parts", (*self.parts, 1.0))
"""
PARAMETERS: dict[str, tuple[dict[str, Any], str]] = {
    "says_what_it_is": ({"": '"""A metric of somebody\'s own."""'}, "the file has none"),
    "says_what_it_is class": (
        {"": '"""roughness = the mean size of tau\'s rate, over ticks and joints"""'}, "the class Mine has none",
    ),
    "parameters_have_a_unit_a_meaning_and_bounds": ({"field": "band: float = 1.0"}, "'band' has none: annotate it as"),
    "parameters_have_a_unit_a_meaning_and_bounds meaning": (
        {"field": "band: Annotated[float, Parameter('m')] = 1.0"}, "the Parameter of 'band' has no meaning",
    ),
    "parameters_have_a_unit_a_meaning_and_bounds unit": (
        {"field": "band: Annotated[float, Parameter('furlong', 'width', 0, 2)] = 1.0"},
        "'furlong' is not a unit that hilrig knows",
    ),
    "parameters_have_a_unit_a_meaning_and_bounds outside": (
        {"field": "band: Annotated[float, Parameter('m', 'width', 0, 2)] = 3.0"}, "'band' is 3, outside of [0, 2]",
    ),
    "parameters_have_a_unit_a_meaning_and_bounds bounds": (
        {"field": "band: Annotated[float, Parameter('m', 'width', 2, 0)] = 3.0"}, "the bounds of 'band' are 2 and 0",
    ),
    "parameters_can_be_read_from_an_experiment": (
        {"field": "band: object = None"}, "the type of parameter 'band' cannot come from a file: object",
    ),
    "can_be_written_into_a_plan_and_read_back": (
        {"field": "table: tuple = (np.zeros(2),)"}, "it raised ValueError: The truth value of an array",
    ),
    "can_be_written_into_a_plan_and_read_back other": (
        {"field": GROWING},
        "came back as Mine(parts=((1.0, 2.0), 1.0, 1.0))",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", PARAMETERS)
def test_each_fault_of_the_parameters_is_noticed(tmp_path: Path, fault: str) -> None:
    replacements, words = PARAMETERS[fault]
    source = METRIC.replace(replacements[""], "") if "" in replacements else changed(METRIC, **replacements)
    assert source != METRIC
    assert_noticed("metrics", source, tmp_path, fault.split()[0], words)


@pytest.mark.parametrize(
    ("group", "source", "first"),
    [
        ("references", changed(REFERENCE, sample="1 / 0"), "samples_are_three_finite_arrays"),
        ("disturbances", changed(DISTURBANCE, apply="1 / 0"), "it_can_be_applied"),
        ("metrics", changed(METRIC, measure="1 / 0"), "values_are_finite_numbers_by_axis"),
    ],
)
def test_an_exception_is_told_once(tmp_path: Path, group: str, source: str, first: str) -> None:
    words = "but it raised ZeroDivisionError: division by zero (line "
    assert_the_first_rule_alone(group, source, tmp_path, first, words)
