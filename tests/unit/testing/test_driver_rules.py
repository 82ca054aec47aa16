"""Simulated plants that each break one rule, and a real one that nobody may move."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers.builders import arm, surface
from helpers.rules import assert_noticed, assert_the_first_rule_alone, broken, changed

GOOD = '''
"""A plant of somebody's own: hilrig's arm, one call away."""
import time
from dataclasses import dataclass
from typing import ClassVar
import numpy as np
from hilrig import Capabilities, PlantDisturbance, PlantKernels, Robot, Surface
from hilrig_drivers.two_link import TwoLink

@dataclass(frozen=True)
class Mine:
    """M(q) q'' + C(q, q') q' + G(q) + J^T F = tau"""

    capabilities: ClassVar[Capabilities] = Capabilities(
        ("lockstep",), ("plant_tip_force", "plant_surface_offset", "plant_surface_friction_scale"), simulated=True)
    robot: Robot
    surface: Surface
    # field

    servo_gain = None
    # class

    @property
    def surface_position(self):
        return self.surface.position

    def connect(self, start):
        # connect
        return Arm(TwoLink(self.robot, self.surface).connect(start))

    # render


class Arm:
    def __init__(self, plant):
        self.plant, self.closed, self.last = plant, 0, None

    def measure(self, disturbance):
        seen = self.plant.measure(disturbance)
        # measure
        return seen

    def advance(self, command, disturbance):
        # advance
        self.plant.advance(command, disturbance)

    def holding_command(self):
        # holding_command
        return self.plant.holding_command()

    def truth(self, disturbance):
        true = self.plant.truth(disturbance)
        # truth
        return true

    def close(self):
        # close
        self.closed += 1

    # plant
'''
SPINNING = """
        if not hasattr(self, "clock"):
            self.clock = time.monotonic()
        seen = seen._replace(joint_position=seen.joint_position + 1e-3 * (time.monotonic() - self.clock))
"""
LIGHT = """
        free = TwoLink(self.robot, Surface(9.0)).connect(start)
        free.measure(PlantDisturbance(np.zeros(2), 0.0, 0.0, 1.0, 1.0, 1.0))
        Arm.light = free.holding_command()
"""
KERNELS = """
    def kernels(self):
        fine = self.plant.kernels()
        def advance(constants, state, disturbance, torque, reference):
            fine.advance(constants, state, disturbance, torque * 1.0000001, reference)
        return PlantKernels(fine.observe, advance, fine.constants, fine.state)
"""
BUFFER = """
        self.room = getattr(self, "room", np.zeros(2))
        self.room[:] = seen.joint_position
        seen = seen._replace(joint_position=self.room)
"""

FAULTS = {
    "capabilities_are_of_the_known_words": (
        {"class": "capabilities = Capabilities(('real_time',), (), True)"}, "its clocks are ('real_time',)",
    ),
    "capabilities_are_of_the_known_words disturbance": (
        {"class": "capabilities = Capabilities(('lockstep',), ('tip_force',), True)"}, "it names tip_force",
    ),
    "it_says_what_it_drives": ({"class": "servo_gain = 0.0"}, "its servo gain is 0.0"),
    "measurements_have_their_shapes": (
        {"measure": "seen = seen._replace(wrench=seen.wrench[:3])"}, "its wrench is an array (3,)",
    ),
    "measurements_have_their_shapes list": ({"measure": "seen = tuple(seen)"}, "it returned a tuple"),
    "it_begins_at_rest_where_it_is_told": (
        {"connect": "start = start._replace(joint_position=start.joint_position + 0.01)"}, "it began at [",
    ),
    "it_begins_at_rest_where_it_is_told copy": (
        {"measure": "seen = seen._replace(joint_position=self.start) if self.last is None else seen",
         "connect": "Arm.start = start.joint_position"}, "it began at [nan, nan] rad",
    ),
    "only_advance_moves_the_plant": (
        {"measure": "self.plant.advance(self.plant.holding_command(), disturbance)"}, "after `measure`",
    ),
    "only_advance_moves_the_plant noise": (
        {"measure": "seen = seen._replace(wrench=seen.wrench + np.random.normal(size=6))"},
        "after `measure`, `truth` and",
    ),
    "only_advance_moves_the_plant clock": ({"measure": SPINNING}, "measure().joint_position was ["),
    "advance_moves_the_plant": (
        {"advance": "command = self.plant.holding_command()"}, "moved the tip by [0, 0] m in 60 ms",
    ),
    "the_holding_command_keeps_the_plant": (
        {"holding_command": "return self.plant.holding_command()._replace(torque=np.zeros(2))"},
        "in the air it moved by ",
    ),
    "the_holding_command_keeps_the_plant contact": (
        {"connect": LIGHT, "holding_command": "return self.light"}, "in contact it moved by ",
    ),
    "what_was_measured_stays_as_it_was": ({"measure": BUFFER}, "measure().joint_position went from ["),
    "commands_and_disturbances_are_only_read": (
        {"advance": "command.torque.clip(-1.5, 1.5, out=command.torque)"}, "it wrote into one",
    ),
    "commands_and_disturbances_are_only_read kept": (
        {"advance": "self.last = command.torque",
         "measure": "seen = seen if self.last is None else seen._replace(applied_torque=self.last)"},
        "when the arrays of the last command were used again measure().applied_torque was [nan, nan]",
    ),
    "a_command_does_not_act_after_its_period": (
        {"advance": "self.last, command = command, self.last or command"},
        "when the arrays of earlier commands were used again measure().",
    ),
    "applied_torque_is_what_the_motors_gave": (
        {"measure": "seen = seen._replace(applied_torque=np.zeros(2))"}, "it is [0, 0] N m after",
    ),
    "the_torque_at_the_start_is_what_holds_the_plant": (
        {"measure": "seen = seen if self.last else seen._replace(applied_torque=np.zeros(2))"},
        "it is [0, 0] N m, and `holding_command`",
    ),
    "the_truth_agrees_with_the_measurement": ({"truth": "true = true._replace(wrench=-true.wrench)"}, "its wrench is "),
    "the_truth_agrees_with_the_measurement surface": (
        {"truth": "true = true._replace(surface_position=0.35)"}, "its surface_position is 0.35, and not 0.348",
    ),
    "a_surface_that_is_pressed_pushes_back": (
        {"measure": "seen = seen._replace(wrench=-seen.wrench)", "truth": "true = true._replace(wrench=-true.wrench)"},
        "5 mm in the surface its force along z is -4 N",
    ),
    "every_disturbance_it_declares_acts": (
        {"advance": "disturbance = disturbance._replace(tip_force=-disturbance.tip_force)"}, "which is the wrong way",
    ),
    "every_disturbance_it_declares_acts not": (
        {"advance": "disturbance = disturbance._replace(surface_offset=0.0)"},
        "plant_surface_offset changes nothing; give the test values that have an effect",
    ),
    "an_external_force_is_felt_by_the_sensor": (
        {"measure": "seen = self.plant.measure(disturbance._replace(tip_force=np.zeros(2)))"},
        "N added [0, 0, 0, 0, 0, 0]",
    ),
    "the_same_commands_give_the_same_bits": (
        {"advance": "disturbance = disturbance._replace(surface_offset=1e-6 * np.random.normal())"}, "the second time",
    ),
    "the_same_commands_give_the_same_bits beside": (
        {"connect": "Arm.calls = 0",
         "advance": "Arm.calls += 1; disturbance = disturbance._replace(surface_offset=1e-6 * Arm.calls)"},
        "the second time",
    ),
    "close_may_come_at_any_time": (
        {"close": "assert not self.closed, 'closed twice'"},
        "called a second time it raised AssertionError: closed twice",
    ),
    "close_may_come_at_any_time first": (
        {"close": "self.last.clear() if self.last is None else None"}, "it raised AttributeError: ",
    ),
    "kernels_do_the_same": ({"plant": KERNELS}, "at tick 1 "),
    "pictures_are_of_the_size_asked_for": (
        {"render": "def render(self, q, width, height): return [np.zeros((width, height, 3), np.uint8) for _ in q]"},
        "for two rows at 64 x 48 it returned [((64, 48, 3), 'uint8'), ((64, 48, 3), 'uint8')]",
    ),
}  # fmt: skip
VALUES = {"robot": arm(), "surface": surface(friction=0.3)}


def test_a_good_plant_keeps_every_rule(tmp_path: Path) -> None:
    assert broken("drivers", GOOD, tmp_path, **VALUES) == {}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_noticed_and_told(tmp_path: Path, fault: str) -> None:
    replacements, words = FAULTS[fault]
    assert_noticed("drivers", changed(GOOD, **replacements), tmp_path, fault.split()[0], words, **VALUES)


def test_a_real_plant_is_not_moved(tmp_path: Path) -> None:
    """Its `connect` would raise; what can be said of it without moving it is checked."""
    real = changed(
        GOOD.replace("def connect(self, start):", "def connect(self, start) -> "
        '"Arm":'),
        connect="raise RuntimeError('who moves my arm?')",
        **{"class": "capabilities = Capabilities(('realtime',), (), False, 0.5)"},
        render="def render(self, q, width, height): raise RuntimeError",
        plant="def hold(self): raise RuntimeError",
    )  # fmt: skip
    assert broken("drivers", real, tmp_path, **VALUES) == {}


def test_a_surface_out_of_reach_is_said(tmp_path: Path) -> None:
    sentence = broken("drivers", GOOD, tmp_path, "advance_moves_the_plant", robot=arm(), surface=surface(position=9.0))
    assert "the robot reaches no point on its surface, at 9 m along z; give the test a surface" in str(sentence)


@pytest.mark.parametrize("place", ["connect", "measure", "advance", "holding_command", "truth", "close"])
def test_an_exception_is_told_once(tmp_path: Path, place: str) -> None:
    source, words = changed(GOOD, **{place: "1 / 0"}), "it raised ZeroDivisionError: division by zero (line "
    assert_the_first_rule_alone("drivers", source, tmp_path, "a_plant_begins_and_runs", words, **VALUES)
