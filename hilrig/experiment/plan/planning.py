"""From an experiment to its trials."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from hilrig.core.errors import ExperimentError, PluginError, Problem
from hilrig.core.parameters import per_axis
from hilrig.experiment.plan.feasibility import (
    InfeasibleError,
    check_controller,
    check_disturbances,
    check_driver,
    check_workspace,
    sampled,
)
from hilrig.experiment.trial import PhaseSpec, TaskSpec, Trial
from hilrig.kinds.user_files import code_of

if TYPE_CHECKING:  # the rig's processes read trials and do not need YAML
    from hilrig.experiment import Experiment


def plan(experiment: Experiment) -> tuple[Trial, ...]:
    """Return the trials in the order in which they are run: by repeat, then condition, then controller.

    With this order an interrupted run has trials that can be compared. Raises ExperimentError, with the place in the
    file, if the driver lacks software, a reference leaves the robot's workspace, a kind's parameters do not fit the
    task, or its code fails.
    """
    try:
        with code_of():
            return _checked(experiment)
    except PluginError as error:  # problems of controllers, references and disturbances were already reported by name
        raise ExperimentError([Problem(experiment.place("driver"), str(error))]) from error


def _checked(experiment: Experiment) -> tuple[Trial, ...]:
    draft = _trials(experiment, 0, (0.0,) * len(experiment.driver.robot.axes))
    try:
        check_driver(draft[0])
        start = start_position(experiment, draft[0])
    except InfeasibleError as misfit:
        raise ExperimentError([_problem(experiment, misfit)]) from misfit
    misfits = list(_misfits([replace(trial, start_position=start) for trial in draft]))
    if misfits:
        raise ExperimentError(dict.fromkeys(_problem(experiment, misfit) for misfit in misfits))
    repeats = range(experiment.repeats)
    return tuple(trial for repeat in repeats for trial in _trials(experiment, repeat, start))


def _problem(experiment: Experiment, misfit: InfeasibleError) -> Problem:
    return Problem(experiment.place(*misfit.path), str(misfit))


def _trials(experiment: Experiment, repeat: int, start: tuple[float, ...]) -> list[Trial]:
    task, phases = task_spec(experiment), phase_specs(experiment)
    return [
        Trial(
            id=f"{controller}.{condition}.{repeat}",
            controller_name=controller,
            condition_name=condition,
            repeat=repeat,
            seed=(experiment.seed, repeat),
            period=experiment.period,
            clock=experiment.clock,
            actuation_delay=experiment.actuation_delay,
            driver=experiment.driver,
            controller=law,
            task=task,
            phases=phases,
            disturbances=tuple(disturbances),
            limits=experiment.safety,
            timing=experiment.timing,
            start_position=start,
            rig=experiment.rig,
        )
        for condition, disturbances in experiment.conditions.items()
        for controller, law in experiment.controllers.items()
    ]


def task_spec(experiment: Experiment) -> TaskSpec:
    """Return the task with one entry per axis."""
    task, size = experiment.task, len(experiment.driver.robot.axes)

    def diagonal(name: str) -> tuple[float, ...]:
        return tuple(per_axis(getattr(task.impedance, name), size, name).tolist())

    return TaskSpec(
        task.force_axes, diagonal("inertia"), diagonal("damping"), diagonal("stiffness"),
        task.impedance.states, task.velocity_cutoff, task.impedance.anti_windup, task.on_stale_sample,
    )  # fmt: skip


def phase_specs(experiment: Experiment) -> tuple[PhaseSpec, ...]:
    """Return the phases with start and end, both whole numbers of periods."""
    specs: list[PhaseSpec] = []
    period, tick = experiment.period, 0
    for phase in experiment.phases:
        start, tick = tick, tick + round(phase.duration / period)
        specs.append(PhaseSpec(phase.name, start * period, tick * period, phase.position, phase.force))
    return tuple(specs)


def start_position(experiment: Experiment, trial: Trial) -> tuple[float, ...]:
    """Return where the tip starts, (m,) m: as given, else on the reference or the surface.

    Raises InfeasibleError.
    """
    return tuple(_start_on(experiment, trial, axis) for axis in trial.axes)


def _start_on(experiment: Experiment, trial: Trial, axis: str) -> float:
    told, normal = experiment.task.start, trial.axes[-1]
    if axis in told:
        return told[axis]
    if axis not in trial.task.force_axes:
        return float(sampled(trial, axis)[0])
    if axis == normal:
        return trial.driver.surface_position
    message = f"'start' is missing for the force-controlled axis '{axis}': the surface faces {normal}"
    raise InfeasibleError(("task",), message)


def _misfits(trials: list[Trial]) -> Iterator[InfeasibleError]:
    """Yield what is wrong with the trials of one repeat; what they share is checked once."""
    conditions = {trial.condition_name: trial for trial in trials}
    controllers = {trial.controller_name: trial for trial in trials}
    checks = [
        (check_disturbances, conditions),
        (check_workspace, conditions),
        (check_controller, controllers),
    ]
    for check, shared in checks:
        found = False
        for trial in shared.values():
            try:
                check(trial)
            except InfeasibleError as misfit:
                found = True
                yield misfit
        if found:  # the following checks rely on this one
            return
