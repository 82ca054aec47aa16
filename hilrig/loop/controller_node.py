"""The controller node's part of a trial: kinematics, velocity filter, reference, law and torque limits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hilrig.core.compiler import assembled
from hilrig.core.errors import HilrigError, Tripped
from hilrig.core.interfaces import Law
from hilrig.core.law_memory import memory_sizes
from hilrig.core.signals import Array
from hilrig.experiment.trial import Trial, first_state, make_task
from hilrig.loop.control import ControllerArrays, controller_arrays, controller_template, hear_template, observing
from hilrig.loop.plain_parts import LawParts, law_parts, robot_kernels, wrong_torque
from hilrig.loop.rows import ControllerRows, StateRows


class ControllerNode:
    """Starts the law at the first measurement, and answers every one."""

    def __init__(self, trial: Trial) -> None:
        self.trial = trial
        self.arrays: ControllerArrays = controller_arrays(trial)
        self.robot = robot_kernels(trial.driver.robot)
        self.observe = observing(self.robot)
        self._rows: ControllerRows | None = None
        self._heard: StateRows | None = None
        self._answers: Iterator[bool] | None = None
        self._row = -1
        self.law: Law | None = None

    def start(self, tick: int, q: Array, wrench: Array, applied_torque: Array) -> dict[str, int]:
        """Start the law at the first measurement: q (n,) rad, wrench (6,), torque in effect (n,) N m.

        Returns the length of every field of the law's memory. Raises PluginError if the law cannot be recorded.
        """
        self.arrays.position[:] = q
        self.arrays.torque[:] = applied_torque
        elapsed = max(tick, 1) * self.trial.period
        state = first_state(self.trial, q, wrench[self.arrays.force_index], applied_torque, elapsed)
        law = self.trial.controller.start(make_task(self.trial), state)
        sizes = memory_sizes(law.memory, self.trial.controller_name)
        self.parts: LawParts = law_parts(law, self.trial)
        self.law = law
        return sizes

    def bind(self, heard: StateRows, rows: ControllerRows) -> None:
        """Set where measurements arrive (the first row of `heard`) and where answers are recorded (`rows`)."""
        self._heard, self._rows = heard, rows

    def answer(self) -> int:
        """Answer the measurement in `heard`; return the row of the answer.

        Raises Tripped if the law's torque is not finite, PluginError if it is not one number for each joint.
        """
        if self._answers is None:
            self._answers = self._begin()
        if not next(self._answers):
            assert self._heard is not None
            raise self.why_refused(int(self._heard.tick[0]))
        self._row = (self._row + 1) % self._count
        return self._row

    def _begin(self) -> Iterator[bool]:
        heard, rows = self._heard, self._rows
        assert heard is not None, "bind() comes first"
        assert rows is not None
        self._count = rows.command.tick.size
        if self.law is None:
            self.start(int(heard.tick[0]), heard.joint_position[0], heard.wrench[0], heard.applied_torque[0])
        law, parts = self.law, self.parts
        assert law is not None
        hear = assembled(hear_template, makes_arrays=False, observe=self.observe)
        answers = assembled(controller_template, hear=hear, law_step=parts.step)
        return answers(law.parameters, law.memory, parts.fields, self.robot.constants, self.arrays, rows, heard)

    def why_refused(self, tick: int) -> HilrigError:
        """Return the error for the law's last torque, which could not be commanded."""
        size = int(self.arrays.asked_size[0])
        if size != self.arrays.asked.size:
            return wrong_torque((size,), self.trial)
        name, asked = self.trial.controller_name, self.arrays.asked
        if np.isfinite(asked).all():
            return Tripped(
                f"tick {tick}: the torque of controller '{name}' is beyond a limit that ends the trial "
                f"(safety.trip_on: {', '.join(self.trial.limits.trip_on)}): {asked} N m"
            )
        return Tripped(f"tick {tick}: the torque of controller '{name}' is not finite: {self.arrays.asked}")
