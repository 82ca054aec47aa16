"""Checks across the parts of an experiment: whether they fit each other."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from hilrig.core.errors import PluginError, nearest
from hilrig.core.interfaces import Capabilities, is_fault
from hilrig.core.parameters import per_axis
from hilrig.core.quantities import shown
from hilrig.experiment.document import Keys
from hilrig.experiment.expecting import check_expectation, complete_expectation
from hilrig.experiment.model import Experiment, Phase
from hilrig.experiment.rig_settings import RigSettings
from hilrig.experiment.schema import ONLY_AXIS, InvalidError, SchemaFinding
from hilrig.experiment.trial import ALL_PHASES
from hilrig.kinds import registry as plugins
from hilrig.kinds.hardware import lacks
from hilrig.kinds.user_files import code_of

MIN_TICKS = 2
"""With fewer there is no rate and nothing to compare"""
MAX_TICKS = 5_000_000
"""A trial's references and disturbances are held in memory."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


def cross_checked(experiment: Experiment) -> Experiment:
    """Return the experiment with every reference under its axis and every expectation in its metric's unit.

    Raises InvalidError with everything that does not fit together.
    """
    findings = list(_check_driver(experiment))
    if findings:  # the other checks use the driver
        raise InvalidError(findings)
    findings += [
        *_check_names(experiment), *_check_task(experiment), *_check_time(experiment),
        *_check_abilities(experiment), *_check_faults(experiment), *_check_timing(experiment),
        *_check_safety(experiment),
    ]  # fmt: skip
    phases, expect = [], []
    axes_known = set(experiment.task.force_axes) <= set(experiment.driver.robot.axes)
    for i, phase in enumerate(experiment.phases if axes_known else ()):
        phases.append(_complete_phase(experiment, phase, i, findings))
    for i, expectation in enumerate(experiment.expect):
        findings += check_expectation(experiment, expectation, i)
        expect.append(complete_expectation(expectation, i, findings))
    if findings:
        raise InvalidError(findings)
    return replace(experiment, phases=tuple(phases), expect=tuple(expect))


def _check_names(experiment: Experiment) -> Iterator[SchemaFinding]:
    yield from _check_name(experiment.name, ("name",), on_key=False)
    groups: dict[str, Mapping[str, Any]] = {
        "controllers": experiment.controllers,
        "conditions": experiment.conditions,
    }
    for group, named in groups.items():
        if not named:
            yield SchemaFinding((group,), f"there are no {group}; an experiment needs at least one")
        for name in named:
            yield from _check_name(name, (group, name), on_key=True)
        yield from _check_unique([(name, (group, name)) for name in named], on_key=True)
    if not experiment.phases:
        yield SchemaFinding(("phases",), "there are no phases; an experiment needs at least one")
    for i, phase in enumerate(experiment.phases):
        yield from _check_name(phase.name, ("phases", i, "name"), on_key=False)
        if phase.name == ALL_PHASES:
            yield SchemaFinding(
                ("phases", i, "name"), f"'{ALL_PHASES}' stands for all phases together; give the phase another name"
            )
    yield from _check_unique([(p.name, ("phases", i, "name")) for i, p in enumerate(experiment.phases)], on_key=False)


def _check_name(name: str, path: Keys, on_key: bool) -> Iterator[SchemaFinding]:
    if not _NAME.fullmatch(name):
        message = (
            f"{shown(name)} cannot be a name: it becomes part of a folder name; use at most 64 of A-Z, a-z, 0-9, '_' "
            "and '-', starting with a letter or digit"
        )
        yield SchemaFinding(path, message, on_key)


def _check_unique(named: Iterable[tuple[str, Keys]], on_key: bool) -> Iterator[SchemaFinding]:
    """Yield repeated names: they become folders, and on some file systems 'PD' and 'pd' are the same."""
    seen: dict[str, str] = {}
    for name, path in named:
        if name.lower() in seen:
            yield SchemaFinding(path, f"the name '{name}' is already taken by '{seen[name.lower()]}'", on_key)
        seen.setdefault(name.lower(), name)


def _check_task(experiment: Experiment) -> Iterator[SchemaFinding]:
    axes, task = experiment.driver.robot.axes, experiment.task
    for i, axis in enumerate(task.force_axes):
        if axis not in axes:
            yield SchemaFinding(("task", "force_axes", i), _no_axis(axis, axes))
        elif axis in task.force_axes[:i]:
            yield SchemaFinding(("task", "force_axes", i), f"the axis '{axis}' is listed twice")
    for axis in task.start:
        if axis not in axes:
            yield SchemaFinding(("task", "start", axis), _no_axis(axis, axes), on_key=True)
    for name in ("inertia", "damping", "stiffness"):
        try:
            per_axis(getattr(task.impedance, name), len(axes), name)
        except ValueError as error:
            yield SchemaFinding(("task", "impedance", name), f"{error} (axes: {', '.join(axes)})")


def _no_axis(axis: str, axes: tuple[str, ...]) -> str:
    return f"the robot has no axis '{axis}'{nearest(axis, axes)} (axes: {', '.join(axes)})"


def _check_time(experiment: Experiment) -> Iterator[SchemaFinding]:
    period, ticks = experiment.period, 0
    for i, phase in enumerate(experiment.phases):
        whole = round(phase.duration / period)
        ticks += whole
        if whole < 1 or abs(whole * period - phase.duration) > 1e-6 * period:
            message = f"{phase.duration:g} s is not a whole number of periods of {period:g} s"
            yield SchemaFinding(("phases", i, "duration"), message)
    spin = experiment.rig.spin
    if experiment.clock == "realtime" and spin >= period:
        path: Keys = ("period",) if spin == RigSettings.spin else ("rig", "spin")
        message = (
            f"a period of {period:g} s leaves no time to sleep: 'rig.spin', the part of each wait that is spent "
            f"busy-waiting, is {spin:g} s; set it to less than the period"
        )
        yield SchemaFinding(path, message)
    if experiment.phases and not MIN_TICKS <= ticks <= MAX_TICKS:
        yield SchemaFinding(("phases",), f"{ticks} ticks in all; a trial has {MIN_TICKS} to {MAX_TICKS}")


def _check_driver(experiment: Experiment) -> Iterator[SchemaFinding]:
    """Yield what is wrong with the attributes of a user's driver that the other checks rely on."""
    try:
        with code_of(experiment.driver):
            capabilities, axes = experiment.driver.capabilities, experiment.driver.robot.axes
            if not isinstance(capabilities, Capabilities):
                raise ValueError(f"capabilities is a {type(capabilities).__name__}; it must be a Capabilities")
            named = isinstance(axes, tuple) and all(isinstance(axis, str) and _NAME.fullmatch(axis) for axis in axes)
            if not named or not axes or len(set(axes)) < len(axes):
                raise ValueError(f"the robot's axes are {axes!r}; they must be a tuple of distinct names, such as 'x'")
            lacking = lacks(experiment.driver)
    except PluginError as error:
        yield SchemaFinding(("driver",), str(error))
        return
    for sentence in lacking:
        yield SchemaFinding(("driver",), sentence)


def _check_safety(experiment: Experiment) -> Iterator[SchemaFinding]:
    """Yield limits that are no limits: looser than the robot's own, of the wrong number, or with nothing between."""
    robot, safety, axes = experiment.driver.robot, experiment.safety, experiment.driver.robot.axes
    try:
        with code_of(experiment.driver):
            own, (low, high) = robot.torque_limits(), safety.joint_range(robot)
    except PluginError as error:
        yield SchemaFinding(("driver",), str(error))
        return
    for name in ("torque", "torque_rate", "position_rate"):
        value = getattr(safety, name)
        try:
            given = per_axis(0.0 if value is None else value, robot.joints, name)
        except ValueError as error:
            yield SchemaFinding(("safety", name), f"{error} (joints: {robot.joints})")
            continue
        if name == "torque" and (given > own).any():
            joint = int((given - own).argmax())
            message = (
                f"{given[joint]:g} N m is more than the robot's own limit of joint {joint + 1}, {own[joint]:g} N m; an "
                "experiment can only be stricter"
            )
            yield SchemaFinding(("safety", name), message)
    for axis, ends in safety.workspace.items():
        path: Keys = ("safety", "workspace", axis)
        if axis not in axes:
            yield SchemaFinding(path, _no_axis(axis, axes), on_key=True)
        elif len(ends) != 2 or not ends[0] < ends[1]:
            yield SchemaFinding(path, f"{list(ends)} is no range: give the lowest and the highest position, in m")
    if (low >= high).any():
        joint = int((low - high).argmax())
        yield SchemaFinding(("safety", "joint_margin"), f"it leaves joint {joint + 1} nowhere to be")
    if experiment.driver.servo_gain is None and ("position" in safety.trip_on or "position_rate" in safety.trip_on):
        yield SchemaFinding(("safety", "trip_on"), "this driver takes torques, and positions are not commanded")


def _check_abilities(experiment: Experiment) -> Iterator[SchemaFinding]:
    capabilities = experiment.driver.capabilities
    if experiment.clock not in capabilities.clocks:
        able = ", ".join(capabilities.clocks)
        message = f"the driver cannot run with the clock '{experiment.clock}' (it can: {able})"
        yield SchemaFinding(("clock",), message)
    if experiment.actuation_delay == 0 and experiment.clock != "lockstep":
        message = "0 is possible only with the clock 'lockstep'; in real time 1 to 10 are allowed"
        yield SchemaFinding(("actuation_delay",), message)
    for name, disturbances in experiment.conditions.items():
        for i, disturbance in enumerate(disturbances):
            beyond = [
                field
                for field in disturbance.acts_on
                if field.startswith("plant_") and field not in capabilities.disturbances
            ]
            if beyond:
                kind = plugins.name_of(type(disturbance))[1]
                able = ", ".join(capabilities.disturbances) or "none"
                message = f"the driver cannot apply '{kind}', which acts on {', '.join(beyond)} (it can: {able})"
                yield SchemaFinding(("conditions", name, i), message)


def _check_faults(experiment: Experiment) -> Iterator[SchemaFinding]:
    """Yield faults without a real-time loop: in lockstep nothing is late, and a lost message would block it forever."""
    for name, disturbances in experiment.conditions.items():
        for i, disturbance in enumerate(disturbances):
            if is_fault(disturbance) and experiment.clock != "realtime":
                kind = plugins.name_of(type(disturbance))[1]
                wanted = f"it needs the clock 'realtime', not '{experiment.clock}'"
                message = f"'{kind}' is a fault of the real-time loop: {wanted}"
                yield SchemaFinding(("conditions", name, i), message)


def _check_timing(experiment: Experiment) -> Iterator[SchemaFinding]:
    age, least = experiment.timing.command_age_p99, experiment.actuation_delay * experiment.period
    if age is not None and age <= least:
        message = (
            f"{1e3 * age:g} ms cannot be kept: with an actuation delay of {experiment.actuation_delay} and a period "
            f"of {1e3 * experiment.period:g} ms a command is {1e3 * least:g} ms old when it takes effect; "
            "allow more than that"
        )
        yield SchemaFinding(("timing", "command_age_p99"), message)


def _complete_phase(experiment: Experiment, phase: Phase, index: int, findings: list[SchemaFinding]) -> Phase:
    """Return the phase with a reference under each axis; problems are added to `findings`."""
    force = tuple(axis for axis in experiment.driver.robot.axes if axis in experiment.task.force_axes)
    position = tuple(axis for axis in experiment.driver.robot.axes if axis not in force)
    for name, axes in (("position", position), ("force", force)):
        given = getattr(phase, name)
        if ONLY_AXIS in given and len(axes) == 1:
            phase = replace(phase, **{name: {axes[0]: given[ONLY_AXIS]}})
        else:
            findings += _check_axes(given, axes, ("phases", index), name)
    return phase


def _check_axes(given: Mapping[str, Any], axes: tuple[str, ...], path: Keys, name: str) -> Iterator[SchemaFinding]:
    listed = ", ".join(axes) or "none"
    if ONLY_AXIS in given:
        example = f" write {{{axes[0]}: {{kind: ...}}, ...}}" if axes else ""
        yield SchemaFinding((*path, name), f"which axis is this for?{example} ({name}-controlled axes: {listed})")
        return
    for axis in given:
        if axis not in axes:
            message = f"the axis '{axis}' is not {name}-controlled{nearest(axis, axes)} ({name}-controlled: {listed})"
            yield SchemaFinding((*path, name, axis), message, on_key=True)
    for axis in axes:
        if axis not in given:
            yield SchemaFinding(
                (*path, name) if given else path,
                f"'{name}' is missing for the {name}-controlled axis '{axis}'",
            )
