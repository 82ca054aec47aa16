from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.builders import arm, surface
from helpers.experiments import EXPERIMENTS, parameters
from hilrig_drivers import pybullet_arm

from hilrig.core.errors import ExperimentError, HilrigError
from hilrig.core.interfaces import POSITION_CLIP, VELOCITY_CLIP, TrialStart
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.experiment.rig_settings import RigSettings
from hilrig.experiment.trial import (
    Limits,
    Trial,
    disturbance_schedule,
    make_impedance,
    make_task,
    references,
    start_joint_position,
    times,
)
from hilrig.kinds.registry import dump, restore

TEXT = """\
hilrig: 1
name: example
question: Is it planned?
period: 1 ms
repeats: 2
seed: 7
driver:
  kind: two_link
  robot: {kind: planar_2r, lengths: [0.345 m, 0.2 m], masses: [1.8 kg, 1.1 kg]}
  surface: {position: 0.35 m}
task:
  force_axes: [z]
  impedance: {inertia: [3, 6], damping: 30, stiffness: [250, 0]}
  velocity_cutoff: 60 Hz
safety: {tip_force: 90 N, joint_velocity: 3 rad/s}
phases:
  - name: swing
    duration: 0.7 s
    position: {kind: sine, amplitude: 0.1 m, frequency: 1 rad/s, angle: 1 rad}
    force: {kind: hold, value: 3}
  - {name: move, duration: 0.3 s, position: {kind: min_jerk, end: 0.2 m}, force: {kind: hold, value: 4}}
conditions:
  quiet: []
  noisy: [{kind: sensor_noise, force: 0.05 N, joint: 2e-5}, {kind: sensor_noise, force: 0.05 N}]
controllers:
  proposed: {kind: tde_sliding_mode}
  pd: {kind: pd, stiffness: [1000, 333.3333333333333]}
"""


def planned(folder: Path, text: str = TEXT, *overrides: str) -> tuple[Trial, ...]:
    """Return the trials of an experiment file."""
    path = folder / "example.yaml"
    path.write_text(text)
    return plan(load(path, overrides))


def refused(folder: Path, *overrides: str) -> ExperimentError:
    """Return the error with which an experiment is refused."""
    with pytest.raises(ExperimentError) as caught:
        planned(folder, TEXT, *overrides)
    return caught.value


def test_trials_come_by_repeat_then_condition_then_controller(tmp_path: Path) -> None:
    assert [trial.id for trial in planned(tmp_path)] == [
        "proposed.quiet.0", "pd.quiet.0", "proposed.noisy.0", "pd.noisy.0",
        "proposed.quiet.1", "pd.quiet.1", "proposed.noisy.1", "pd.noisy.1",
    ]  # fmt: skip


def test_a_trial_survives_json_bit_for_bit(tmp_path: Path) -> None:
    for trial in planned(tmp_path):
        back = Trial.from_document(json.loads(json.dumps(trial.to_document(), allow_nan=False)))
        assert back == trial
        for one, other in zip(references(back), references(trial), strict=True):
            np.testing.assert_array_equal(one, other)
        for one, other in zip(disturbance_schedule(back), disturbance_schedule(trial), strict=True):
            np.testing.assert_array_equal(one, other)


def test_every_controller_meets_the_same_world_and_every_repeat_another(tmp_path: Path) -> None:
    worlds = {trial.id: disturbance_schedule(trial) for trial in planned(tmp_path)}
    for one, other in zip(worlds["proposed.noisy.1"], worlds["pd.noisy.1"], strict=True):
        np.testing.assert_array_equal(one, other)
    first, second = worlds["pd.noisy.0"].wrench_error, worlds["pd.noisy.1"].wrench_error
    assert not np.array_equal(first, second)
    assert not worlds["pd.quiet.0"].wrench_error.any()


def test_disturbances_of_one_condition_are_independent(tmp_path: Path) -> None:
    noise = disturbance_schedule(planned(tmp_path)[2]).wrench_error[:, 0]
    assert noise.std() == pytest.approx(0.05 * np.sqrt(2), rel=0.1)  # the same draws twice would give 0.1


def test_the_seed_is_the_experiments(tmp_path: Path) -> None:
    one, other = (disturbance_schedule(planned(tmp_path, TEXT, f"seed={seed}")[2]) for seed in (7, 8))
    assert not np.array_equal(one.wrench_error, other.wrench_error)


def test_ticks_and_phases_meet_without_gap(tmp_path: Path) -> None:
    trial = planned(tmp_path)[0]
    assert trial.ticks == 1000
    assert times(trial)[-1] == pytest.approx(0.999)
    assert [(trial.tick_of(phase.start), trial.tick_of(phase.end)) for phase in trial.phases] == [
        (0, 700),
        (700, 1000),
    ]


def test_references_change_at_the_phases_first_tick(tmp_path: Path) -> None:
    reference = references(planned(tmp_path)[0])
    assert reference.force[699].tolist() == [0.0, 3.0]
    assert reference.force[700].tolist() == [0.0, 4.0]
    assert reference.position.shape == reference.acceleration.shape == (1000, 2)
    assert not reference.position[:, 1].any()
    np.testing.assert_allclose(reference.position[:700, 0], 0.1 * np.sin(np.arange(700) * 1e-3 + 1.0), atol=1e-15)


def test_a_move_takes_over_where_the_phase_before_ended(tmp_path: Path) -> None:
    reference = references(planned(tmp_path)[0])
    assert reference.position[700, 0] == pytest.approx(0.1 * np.sin(1.7), abs=1e-15)
    assert reference.velocity[700, 0] == 0.0
    assert reference.position[999, 0] == pytest.approx(0.2, abs=1e-5)


def test_the_tip_starts_on_its_references_and_on_the_surface(tmp_path: Path) -> None:
    trial = planned(tmp_path)[0]
    assert trial.start_position == pytest.approx((0.1 * np.sin(1.0), 0.35))
    robot = trial.driver.robot
    np.testing.assert_allclose(robot.forward_kinematics(start_joint_position(trial)), trial.start_position)


def test_the_tip_starts_where_it_is_told_to(tmp_path: Path) -> None:
    trial = planned(tmp_path, TEXT, "task.start={x: 0.05 m, z: 0.3 m}")[0]
    assert trial.start_position == (0.05, 0.3)


def test_a_start_out_of_reach_is_refused_with_its_place(tmp_path: Path) -> None:
    """The arm reaches 0.545 m; the references and the surface are within reach."""
    with pytest.raises(ExperimentError) as caught:
        planned(tmp_path, TEXT.replace("task:\n", "task:\n  start: {x: 0.5 m, z: 0.3 m}\n"))
    (problem,) = caught.value.problems
    assert "the start: x = 0.5 m, z = 0.3 m is out of reach" in problem.message
    assert problem.place is not None
    assert problem.place.line == TEXT.splitlines().index("task:") + 2, "the line below `task:`"


def test_the_task_has_one_entry_an_axis(tmp_path: Path) -> None:
    trial = planned(tmp_path)[0]
    desired = make_impedance(trial.task, trial.axes)
    assert desired.sigma.tolist() == [1.0, 0.0]
    assert desired.damping.tolist() == [30.0, 30.0]
    assert desired.inertia.tolist() == [3.0, 6.0]
    assert not desired.reference_states
    assert trial.limits == Limits(tip_force=90.0, joint_velocity=3.0)
    task = make_task(trial)
    assert (task.period, task.axes, trial.task.velocity_cutoff) == (1e-3, ("x", "z"), 60.0)
    np.testing.assert_array_equal(task.torque_limit, trial.driver.robot.torque_limits())


def test_the_filter_runs_on_its_own_states_where_it_is_told_to(tmp_path: Path) -> None:
    trial = planned(tmp_path, TEXT, "task.impedance.states=reference")[0]
    assert make_impedance(trial.task, trial.axes).reference_states


def test_the_filter_is_kept_near_the_measured_state_unless_it_is_told_not_to(tmp_path: Path) -> None:
    kept = planned(tmp_path)[0]
    desired = make_impedance(kept.task, kept.axes)
    assert (desired.velocity_clip, desired.position_clip) == (VELOCITY_CLIP, POSITION_CLIP) == (0.1, 0.02)
    free = planned(tmp_path, TEXT, "task.impedance.anti_windup=none")[0]
    assert Trial.from_document(json.loads(json.dumps(free.to_document()))) == free
    desired = make_impedance(free.task, free.axes)
    assert (desired.velocity_clip, desired.position_clip) == (np.inf, np.inf)


def test_a_plan_written_before_there_was_a_choice_of_anti_windup_has_it(tmp_path: Path) -> None:
    trial = planned(tmp_path)[0]
    document = trial.to_document()
    del document["task"]["anti_windup"]
    assert Trial.from_document(document) == trial


def test_the_real_time_set_up_travels_with_the_trial(tmp_path: Path) -> None:
    assert planned(tmp_path)[0].rig == RigSettings()
    trial = planned(tmp_path, TEXT, "rig={scheduler: other, spin: 2e-5, cpu_dma_latency: null, lock_memory: false}")[0]
    assert trial.rig == RigSettings(scheduler="other", spin=2e-5, cpu_dma_latency=None, lock_memory=False)
    assert Trial.from_document(json.loads(json.dumps(trial.to_document()))) == trial


def test_a_plan_written_before_there_was_a_set_up_has_the_default(tmp_path: Path) -> None:
    trial = planned(tmp_path)[0]
    document = trial.to_document()
    del document["rig"]
    assert Trial.from_document(document) == trial


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("rig.scheduler=fifi", "'fifi' is not allowed; did you mean 'fifo'? (allowed: 'fifo', 'batch', 'other')"),
        ("rig.priority=100", "100"),
        ("rig={spin: 11 ms}", "'11 ms' is not allowed; this needs a time, e.g. '1 ms' (from 0 to 0.01 s)"),
        ("rig.lock_memry=true", "unknown key 'lock_memry'; did you mean 'lock_memory'?"),
    ],
)
def test_a_set_up_that_cannot_be_is_refused(tmp_path: Path, change: str, message: str) -> None:
    with pytest.raises(ExperimentError) as raised:
        planned(tmp_path, TEXT, change)
    assert message in str(raised.value)


def test_out_of_reach_names_the_first_tick_where_it_is(tmp_path: Path) -> None:
    error = refused(tmp_path, "phases.swing.position={kind: sine, amplitude: 0.9 m, frequency: 1 rad/s}")
    first = np.flatnonzero(np.hypot(0.9 * np.sin(np.arange(700) * 1e-3), 0.35) > 0.545)[0]
    assert f"phase 'swing', t = {first * 1e-3:.4g} s" in str(error)


@pytest.mark.parametrize("far", [0.45, -0.45])
def test_a_short_excursion_between_two_looks_is_found(tmp_path: Path, far: float) -> None:
    times_, values = "[0, 102 ms, 104 ms, 106 ms, 200 ms]", f"[0, 0.1, {far}, 0.1, 0]"
    spike = f"{{kind: waypoints, times: {times_}, values: {values}, interpolation: linear}}"
    assert f"phase 'swing', t = 0.104 s: x = {far} m" in str(refused(tmp_path, f"phases.swing.position={spike}"))


def test_a_surface_that_moves_out_of_reach_is_refused(tmp_path: Path) -> None:
    move = "{kind: surface_motion, amplitude: 0.3 m, frequency: 10 rad/s, ramp: 0.1 s}"
    error = refused(tmp_path, f"conditions.quiet=[{move}]")
    assert "out of reach" in str(error)
    assert "z = 0.5" in str(error)


def test_controllers_that_do_not_fit_are_all_named(tmp_path: Path) -> None:
    error = refused(
        tmp_path,
        "controllers.pd.stiffness=[1, 2, 3]",
        "controllers.proposed.inertia_estimate=[1, 2, 3]",
    )
    assert len(error.problems) == 2


@pytest.mark.parametrize("path", parameters(EXPERIMENTS.glob("*.yaml")))
def test_the_projects_own_experiments_can_be_planned(path: Path) -> None:
    counts = {"handrail_comparison": 12, "trajectory_switch": 12, "disturbances": 36, "quickstart": 2}
    trials = plan(load(path))
    assert trials
    assert len(trials) == counts.get(path.stem, len(trials))


@pytest.mark.parametrize(
    ("version", "words"),
    [
        ((3, 13, 0), ("no wheels for Python 3.12 and newer", "use Python 3.11", "--set driver.kind=two_link")),
        ((3, 11, 7), ("is not installed", "pip install 'hilrig[pybullet]'", "--set driver.kind=two_link")),
    ],
)
def test_a_driver_without_its_engine_is_refused_by_name(
    monkeypatch: pytest.MonkeyPatch, version: tuple[int, ...], words: tuple[str, ...]
) -> None:
    monkeypatch.setattr(pybullet_arm, "find_spec", lambda name: None)
    monkeypatch.setattr(sys, "version_info", version)
    file = EXPERIMENTS / "handrail_comparison.yaml"
    experiment = load(file)
    with pytest.raises(ExperimentError) as caught:
        plan(experiment)
    (problem,) = caught.value.problems
    place = problem.place
    assert place is not None
    assert "kind: pybullet_arm" in file.read_text().splitlines()[place.line - 1]
    assert "\n" not in problem.message
    assert all(word in problem.message for word in ("pybullet_arm needs PyBullet", *words))
    assert len(plan(load(file, ["driver.kind=two_link"]))) == 12


def test_the_plan_of_a_run_is_read_without_the_drivers_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    """A report is made on any machine; only a trial needs the engine."""
    driver = pybullet_arm.PybulletArm(arm(), surface())
    monkeypatch.setattr(pybullet_arm, "find_spec", lambda name: None)
    assert restore("drivers", dump(driver)) == driver
    with pytest.raises(HilrigError, match="needs PyBullet"):
        driver.connect(TrialStart(1e-3, np.zeros(2), np.zeros(2)))
    with pytest.raises(HilrigError, match="needs PyBullet"):
        driver.render(np.zeros((1, 2)), 4, 3)
