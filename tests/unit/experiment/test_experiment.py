from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from hilrig.core.errors import ExperimentError
from hilrig.experiment import Experiment, experiment_schema, load
from hilrig.experiment.plan import plan
from hilrig.experiment.plan.assessing import assess
from hilrig.experiment.plan.warnings import warnings
from hilrig.experiment.schema import describe_kind
from hilrig.kinds import registry as plugins
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.references.sine import Sine

STUDY = "reproduce.yaml"
"""A study of several experiments, and none itself"""
FILES = (Path(__file__).parents[3] / "experiments").glob("**/*.yaml")
EXPERIMENTS = sorted(path for path in FILES if path.name != STUDY)

TEXT = """\
hilrig: 1
name: example
question: Does it load?
driver:
  kind: two_link
  robot: {kind: planar_2r, lengths: [345 mm, 0.2], masses: [1.8 kg, 1100 g]}
  surface: {position: 35 cm}
task:
  force_axes: [z]
  impedance: {inertia: 3, damping: [30, 60 N*s/m], stiffness: [250, 0]}
phases:
  - name: first
    duration: 2 s
    position: {kind: sine, amplitude: 10 cm, frequency: 0.5 Hz}
    force: {kind: hold, value: 3}
  - name: second
    duration: 2 s
    position: {x: {kind: hold, value: 0}}
    force: {z: {kind: hold, value: 3.5 N}}
controllers:
  pd: {kind: pd, stiffness: [1000, 500 N/m]}
  proposed: {kind: tde_sliding_mode}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "example.yaml"
    file.write_text(TEXT)
    return file


def refused(path: Path, *overrides: str) -> str:
    """Return the message with which the overrides are refused."""
    with pytest.raises(ExperimentError) as caught:
        load(path, overrides)
    return str(caught.value)


def test_quantities_become_si_numbers(path: Path) -> None:
    experiment = load(path)
    assert experiment.driver.robot.lengths == pytest.approx((0.345, 0.2))
    assert experiment.driver.robot.masses == pytest.approx((1.8, 1.1))
    assert experiment.driver.surface_position == pytest.approx(0.35)
    assert experiment.task.impedance.damping == (30.0, 60.0)
    assert experiment.controllers["pd"].stiffness == (1000.0, 500.0)  # pyright: ignore


def test_what_is_left_out_has_its_default(path: Path) -> None:
    experiment = load(path)
    assert (experiment.period, experiment.clock, experiment.actuation_delay) == (1e-3, "lockstep", 1)
    assert (experiment.repeats, dict(experiment.conditions), experiment.expect) == (1, {"nominal": ()}, ())
    assert experiment.task.velocity_cutoff == 100.0
    assert (experiment.safety.tip_force, experiment.safety.joint_velocity) == (200.0, 20.0)


def test_a_reference_stands_under_its_axis_however_it_was_written(path: Path) -> None:
    first, second = load(path).phases
    assert set(first.position) == set(second.position) == {"x"}
    assert isinstance(first.position["x"], Sine)
    assert first.force == {"z": Hold(3.0)}
    assert second.force == {"z": Hold(3.5)}


def test_the_order_of_controllers_is_the_files(path: Path) -> None:
    assert list(load(path).controllers) == ["pd", "proposed"]


def test_expectations_are_in_the_metrics_unit(path: Path) -> None:
    path.write_text(TEXT + "expect: [{metric: position_rmse, controller: pd, phase: all, below: 5 mm}]\n")
    (expectation,) = load(path).expect
    assert (expectation.below, expectation.above) == (pytest.approx(5e-3), None)


def test_an_expected_outcome_has_no_phase_and_a_metric_has_the_whole_trial(path: Path) -> None:
    path.write_text(TEXT + "expect: [{controller: pd, outcome: tripped}, {metric: effort, controller: pd, below: 1}]\n")
    outcome, metric = load(path).to_document()["expect"]
    assert (outcome["outcome"], outcome["metric"], outcome["phase"]) == ("tripped", None, None)
    assert (metric["outcome"], metric["metric"], metric["phase"]) == (None, "effort", "all")


def test_the_document_is_json_in_si_numbers(path: Path) -> None:
    document = json.loads(json.dumps(load(path).to_document()))
    assert document["driver"]["surface"]["position"] == pytest.approx(0.35)
    assert document["phases"][0]["position"]["x"]["kind"] == "sine"
    assert document["controllers"]["proposed"]["kind"] == "tde_sliding_mode"
    assert "source" not in document


def test_every_value_has_its_place(path: Path) -> None:
    place = load(path).place("phases", 1, "position")
    assert place is not None
    assert (place.file, place.line) == (str(path), 18)


def test_a_csv_file_is_read_from_the_experiments_folder(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (path.parent / "curve.csv").write_text("time,x\n0,0\n1,0.1\n2,0\n")
    path.write_text(TEXT.replace("{x: {kind: hold, value: 0}}", "{kind: csv, file: curve.csv, column: x}"))
    monkeypatch.chdir("/")
    assert load(path).phases[1].position["x"].values == (0.0, 0.1, 0.0)  # pyright: ignore


def with_table(path: Path, content: bytes) -> Path:
    (path.parent / "curve.csv").write_bytes(content)
    path.write_text(TEXT.replace("{x: {kind: hold, value: 0}}", "{kind: csv, file: curve.csv, column: x}"))
    return path


def test_a_byte_order_mark_is_no_part_of_a_columns_name(path: Path) -> None:
    with_table(path, b"\xef\xbb\xbftime,x\r\n0,0\r\n1,0.1")
    assert load(path).phases[1].position["x"].values == (0.0, 0.1)  # pyright: ignore


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("time,x,Größe\n0,0,0\n".encode("latin-1"), "curve.csv:1:10: is not UTF-8 text: byte 0xf6"),
        (b"time,x\n0,0\n1,\x9d\n", "curve.csv:3:3: is not UTF-8 text: byte 0x9d"),
        ("time,x\n0,0\n".encode("utf-16"), "curve.csv:1:1: is not UTF-8 text: it begins with the byte order mark"),
    ],
)  # fmt: skip
def test_a_table_in_another_encoding_is_refused(path: Path, content: bytes, words: str) -> None:
    with pytest.raises(ExperimentError) as caught:
        load(with_table(path, content))
    assert words in str(caught.value)


def test_a_curve_that_outlasts_its_phase_is_warned_of_in_its_place(path: Path) -> None:
    experiment = load(with_table(path, b"time,x\n0,0\n1,0.1\n2000,0\n"))
    found = warnings(experiment, assess(experiment, plan(experiment)))
    ((place, message),) = [problem for problem in found if "points" in problem.message]
    assert place is not None
    assert (place.file, place.line) == (str(path), 18)
    assert message.startswith(
        "phase 'second', axis x: 1 of the curve's 3 points are never reached: its last time is 2000"
    )


OVERRIDES: list[tuple[str, Any]] = [
    ("repeats=3", lambda e: e.repeats == 3),
    ("period=2 ms", lambda e: e.period == 2e-3),
    ("controllers.pd.stiffness=100 N/m", lambda e: e.controllers["pd"].stiffness == 100.0),
    ("controllers.pd.stiffness=[1, 2 N/m]", lambda e: e.controllers["pd"].stiffness == (1.0, 2.0)),
    ("controllers.pd={kind: adaptive}", lambda e: type(e.controllers["pd"]).__name__ == "Adaptive"),
    ("phases.second.duration=5 s", lambda e: e.phases[1].duration == 5.0),
    ("phases.1.duration=5 s", lambda e: e.phases[1].duration == 5.0),
    (
        "timing={late_fraction: 2 %, command_age_p99: 1.2 ms}",
        lambda e: e.timing.late_fraction == 0.02 and e.timing.command_age_limit(1e-3, 1) == 1.2e-3,
    ),
    ("timing.late_fraction=0.01", lambda e: e.timing.late_fraction == 0.01),
    ("safety.tip_force=50 N", lambda e: e.safety.tip_force == 50.0 and e.safety.joint_velocity == 20.0),
    ("task.impedance.states=reference", lambda e: e.task.impedance.states == "reference"),
    ("task.start.x=1 cm", lambda e: e.task.start == {"x": 0.01}),
    ("driver.actuation.mode=position_servo", lambda e: e.driver.actuation.mode == "position_servo"),
    ("conditions={a: []}", lambda e: dict(e.conditions) == {"a": ()}),
]


@pytest.mark.parametrize(("override", "holds"), OVERRIDES, ids=[text for text, _ in OVERRIDES])
def test_override(path: Path, override: str, holds: Any) -> None:
    assert not holds(load(path))
    assert holds(load(path, [override]))


REFUSED = [
    ("repeatz=3", "--set repeatz=3: there is no 'repeatz' in an experiment; did you mean 'repeats'?"),
    (
        "controllers.pdd.stiffness=1",
        "there is no 'pdd' in 'controllers'; did you mean 'pd'? (known: pd, proposed)",
    ),
    ("controller.pd.damping=80", "there is no 'controller' in an experiment; did you mean 'controllers'?"),
    ("controllers.new={kind: pd}", "there is no 'new' in 'controllers'"),
    ("phases.secnd.duration=1 s", "there is no item 'secnd'; did you mean 'second'? (known: first, second)"),
    ("phases.2.duration=1 s", "there is no item '2'"),
    ("safety.force=1", "unknown key 'force'; did you mean 'tip_force'?"),
    ("safte.tip_force=1 N", "--set safte.tip_force=1 N: there is no 'safte' in an experiment; did you mean 'safety'?"),
    ("task.strt.x=3", "--set task.strt.x=3: unknown key 'strt'; did you mean 'start'?"),
    ("driver.surface.stiffnes=3", "unknown key 'stiffnes'; did you mean 'stiffness'?"),
    ("name.x=1", "'name' is a single value; it has no 'x'"),
    ("period=3 kg", "--set period=3 kg: '3 kg' is a mass"),
    ("controllers.pd={kind: pd, stifness: 3}", "stifness: 3}: unknown key 'stifness'"),
    ("repeats", "write path=value"),
    ("=1", "write path=value"),
    ("repeats=[", "is not YAML"),
]


@pytest.mark.parametrize(("override", "words"), REFUSED, ids=[text for text, _ in REFUSED])
def test_a_wrong_override_is_refused(path: Path, override: str, words: str) -> None:
    assert words in refused(path, override)


def test_later_overrides_win(path: Path) -> None:
    assert load(path, ["repeats=2", "repeats=3"]).repeats == 3


@pytest.mark.parametrize("file", EXPERIMENTS, ids=lambda file: file.stem)
def test_the_projects_own_experiments_are_right(file: Path) -> None:
    experiment = load(file)
    assert experiment.question.endswith("?")
    assert file.stem == experiment.name or "paper" in file.parts


def branches(node: Any, kind: str) -> list[dict[str, Any]]:
    """Return every schema within `node` that stands for `kind`."""
    if isinstance(node, list):
        return [found for item in node for found in branches(item, kind)]
    if not isinstance(node, dict):
        return []
    own = [node] if node.get("properties", {}).get("kind", {}) == {"const": kind} else []
    return own + [found for item in node.values() for found in branches(item, kind)]


def test_the_schema_knows_every_key_of_an_experiment() -> None:
    document = json.loads(json.dumps(experiment_schema()))
    assert document["additionalProperties"] is False
    assert {"hilrig", "name", "question", "driver", "task", "phases", "controllers"} == set(document["required"])
    assert set(document["properties"]) == {name for name in Experiment.__dataclass_fields__ if name != "source"}
    assert document["properties"]["clock"]["enum"] == ["lockstep", "realtime"]


@pytest.mark.parametrize("group", ["controllers", "references", "disturbances", "drivers", "robots"])
def test_the_schema_knows_every_kind_and_its_parameters(group: str) -> None:
    document = experiment_schema()
    for kind in plugins.kind_names(group):
        found = branches(document, kind)
        assert found
        names = {row.name.split(".")[0] for row in describe_kind(group, kind)}
        assert set(found[0]["properties"]) == {"kind", *names}
        assert found[0]["additionalProperties"] is False


def test_the_schema_knows_bounds() -> None:
    (found,) = branches(experiment_schema()["properties"]["controllers"], "tde_sliding_mode")
    number, text = found["properties"]["position_gain"]["anyOf"]
    assert (number["minimum"], number["maximum"]) == (1e-3, 1e6)
    assert text["type"] == "string"


def test_parameters_are_described_with_unit_default_and_bounds() -> None:
    rows = {row.name: row for row in describe_kind("drivers", "two_link")}
    assert rows["surface.stiffness"][1:] == ("N/m", "800", 0.0, 1e7, "log", "K_e")
    assert rows["robot.lengths"].default == "required"
    assert rows["actuation.mode"].meaning == "torque | position_servo"
    assert {row.unit for row in describe_kind("references", "hold")} == {"m or N"}
