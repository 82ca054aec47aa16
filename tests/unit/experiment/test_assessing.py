"""Which bounds an experiment keeps, what it is warned of, and what a user's controller may say of itself."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.bounds import BEST, DERIVED, PRINTED, UPPER, estimating, tip_inertia
from helpers.builders import arm
from helpers.experiments import EXPERIMENTS, parameters
from helpers.rules import broken
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.assessment import Bound
from hilrig.core.errors import ExperimentError
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.experiment.plan.assessing import assess, setting_of
from hilrig.experiment.plan.warnings import warnings
from hilrig.kinds.registry import load_kind

QUICKSTART = EXPERIMENTS / "quickstart.yaml"
numbers = st.floats(-1e6, 1e6).filter(lambda value: abs(value) > 1e-6)


def test_the_setting_is_the_loop_and_the_path_that_are_planned() -> None:
    one = estimating()
    setting = setting_of([one])
    assert (setting.task.period, setting.task.axes) == (1e-3, ("x", "z"))
    assert (setting.joint_velocity_limit, setting.tip_force_limit) == (20.0, 200.0)
    assert setting.velocity_smoothing == one.velocity_smoothing
    (path,) = setting.paths
    assert (path.condition, path.delay) == ("", 1)
    np.testing.assert_allclose(path.position[:, 0], 0.3 * np.sin(3 * path.time), atol=1e-12)
    np.testing.assert_allclose(path.position[:, 1], 0.35)
    np.testing.assert_allclose(path.reference.velocity[:, 0], 0.9 * np.cos(3 * path.time), atol=1e-12)
    np.testing.assert_array_equal(path.reference.force, np.tile([0.0, 3.5], (path.time.size, 1)))
    assert path.mobility is not None
    for k in (0, 57, -1):
        inertia = tip_inertia(arm(), *path.position[k])
        np.testing.assert_allclose(path.mobility[k] @ inertia, np.eye(2), atol=1e-9)
    assert len(path.places) == len(path.jacobian) == path.time.size


def test_no_controller_can_change_what_the_next_one_is_told() -> None:
    setting = setting_of([estimating()])
    for array in (setting.task.impedance.damping, setting.paths[0].position, setting.paths[0].reference.force):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0.0


@given(value=numbers, limit=numbers, must=st.sampled_from(["below", "above"]))
def test_a_value_times_its_margin_meets_the_limit(value: float, limit: float, must: Any) -> None:
    bound = Bound("b", value, must, limit, "", "")
    if np.isnan(bound.margin):
        assert value < 0 or limit < 0, "no factor leads from the one to the other"
        return
    factor = bound.margin if must == "below" else 1 / bound.margin
    assert value * factor == pytest.approx(limit)
    assert bound.kept == (bound.margin > 1)


@pytest.mark.parametrize("must", ["below", "above"])
def test_a_value_at_its_limit_does_not_keep_it(must: Any) -> None:
    """The bounds are strict: at the edge the loop neither grows nor decays."""
    assert not Bound("b", 1.0, must, 1.0, "", "").kept


@given(rows=st.lists(st.lists(st.floats(-9, 9), min_size=3, max_size=3), min_size=2, max_size=2))
def test_the_worst_place_is_that_of_the_worst_value(rows: list[list[float]]) -> None:
    (path,) = setting_of([estimating()]).paths
    paths = tuple(path._replace(places=tuple(f"{name}{k}" for k in range(3))) for name in "ab")
    setting = setting_of([estimating()])._replace(paths=paths)
    values = [np.array(row) for row in rows]
    for found, extreme in ((setting.lowest(values), min), (setting.highest(values), max)):
        assert found[0] == extreme(extreme(row) for row in rows)
        assert rows["ab".index(found[1][0])][int(found[1][1])] == found[0]


def test_an_assessment_is_plain_data() -> None:
    experiment = load(QUICKSTART)
    document = json.loads(json.dumps(assess(experiment, plan(experiment)).document()))
    assert list(document["controllers"]) == ["proposed"], "pd says nothing of itself"
    first = document["controllers"]["proposed"]["bounds"][:3]
    assert [bound["name"] for bound in first] == [PRINTED, DERIVED, BEST]
    assert [(bound["kept"], bound["decides"]) for bound in first] == [(False, False), (False, False), (True, True)]
    assert [bound["warning"] for bound in first] == [""] * 3, "what is kept is no warning"
    assert [bound["kept"] for bound in document["task"]["bounds"]] == [True]


def warned(path: Path, overrides: Sequence[str] = ()) -> list[str]:
    experiment = load(path, overrides)
    return [str(problem) for problem in warnings(experiment, assess(experiment, plan(experiment)))]


SHIPPED = [path for path in sorted(EXPERIMENTS.rglob("*.yaml")) if path.name != "reproduce.yaml"]


@pytest.mark.parametrize("path", parameters(SHIPPED))
def test_the_projects_own_experiments_need_no_warning(path: Path) -> None:
    assert warned(path) == []


@pytest.mark.parametrize(
    ("override", "count", "words"),
    [
        ("actuation_delay=2", 0, ""),
        ("actuation_delay=3", 1, "3 ms is over the delay bound (24): 2.82 ms with the best kappa, 0.0178, and 0.75 ms"),
        ("controllers.proposed.inertia_estimate=0.01", 1, "Mhat = 0.01 kg is below 0.0177 kg, the lower edge"),
        ("controllers.proposed.inertia_estimate=0.3", 1, "Mhat = 0.3 kg is above 0.27 kg, the upper edge"),
        ("controllers.proposed.inertia_estimate=[0.3, 0.02]", 1, "condition (9) is not kept: |M_t^-1 Mhat - I| is 1.0"),
        ("controllers.proposed.inertia_estimate=[0.005, 0.01]", 1, "Mhat is too small, by a factor of "),
        ("controllers.proposed.position_gain=1500", 2, "the lower edge"),
        ("task.impedance.damping=[30, 0]", 1, "the damping B_d along z is 0"),
        ("task.impedance.damping=[30, 0.5]", 1, "may reach F_d/B_d = 7 m/s along z (F_d = 3.5 N, phase 'up_and_down')"),
        ("safety={joint_velocity: 0.2 rad/s}", 1, "turn at 0.307 rad/s, over the safety limit of 0.2 rad/s, at phase"),
    ],
)
def test_a_warning_names_value_limit_and_place(override: str, count: int, words: str) -> None:
    told = warned(QUICKSTART, [override])
    assert len(told) == count, told
    assert words == "" or any(words in line for line in told), told


def test_what_several_controllers_hear_is_said_once() -> None:
    told = warned(EXPERIMENTS / "paper" / "errata.yaml", ["actuation_delay=3"])
    (message,) = [line for line in told if "delay bound" in line]
    line = next(i for i, text in enumerate((EXPERIMENTS / "paper" / "errata.yaml").read_text().splitlines(), 1)
                if text.startswith("  as_read:"))  # fmt: skip
    assert f"errata.yaml:{line}:" in message
    assert "controllers 'as_read', 'no_preload': the delay of 3 ms" in message


def with_hook(folder: Path, hook: str, imports: str = "") -> Path:
    """Return the experiment of `my_controller.yaml` in `folder`, its controller with `hook` in addition."""
    source = (EXPERIMENTS / "my_controller.py").read_text()
    known = "from hilrig import Law, Parameter, advance_filter, model_torque"
    assert known in source
    source = source.replace(known, f"from hilrig import Assessment, Bound{imports}\n{known}")
    (folder / "my_controller.py").write_text(f"{source}\n{hook}")
    (folder / "mine.yaml").write_text((EXPERIMENTS / "my_controller.yaml").read_text())
    return folder / "mine.yaml"


def documented() -> str:
    """Return the example of docs/controllers.md."""
    blocks = re.findall(r"```python\n(.*?)```", (EXPERIMENTS.parent / "docs" / "controllers.md").read_text(), re.DOTALL)
    (found,) = [block for block in blocks if "def assess" in block]
    return found


def test_a_users_law_offers_bounds_of_its_own(tmp_path: Path) -> None:
    path = with_hook(tmp_path, documented())
    assert warned(path) == []
    (line,) = warned(path, ["controllers.mine.damping=20"])
    assert "warning" not in line
    assert re.search(r"damping=20: controller 'mine': the damping ratio along x is 0\.\d+, not above 0\.5", line), line
    experiment = load(path)
    (bound,) = assess(experiment, plan(experiment)).controllers["mine"].bounds
    heaviest = max(1 / np.linalg.inv(tip_inertia(arm(), x, 0.35))[0, 0] for x in 0.2 * np.sin(np.arange(0, 6, 0.01)))
    assert bound.value == pytest.approx(50.0 / (2 * np.sqrt(800.0 * heaviest)), rel=1e-4)


def test_the_example_says_what_it_cannot_judge_of_a_robot_without_a_model(tmp_path: Path) -> None:
    with_hook(tmp_path, documented())
    setting = setting_of([estimating()])
    blind = setting._replace(paths=tuple(path._replace(mobility=None) for path in setting.paths))
    found = load_kind("controllers", "./my_controller.py", tmp_path)().assess(blind)
    assert found.bounds == ()
    (sentence,) = found.unknown
    assert sentence.endswith("the robot has no model")


def test_the_documented_hook_keeps_the_rules_of_controllers(tmp_path: Path) -> None:
    with_hook(tmp_path, documented())
    assert broken("controllers", (tmp_path / "my_controller.py").read_text(), tmp_path) == {}


def test_a_users_law_can_ask_for_the_bounds_of_time_delay_estimation(tmp_path: Path) -> None:
    hook = "    def assess(self, setting):\n        return assess_delay_estimation(setting, 0.5, 150.0, 30.0)\n"
    experiment = load(with_hook(tmp_path, hook, ", assess_delay_estimation"))
    found = assess(experiment, plan(experiment)).controllers["mine"]
    assert {bound.name for bound in found.bounds if not bound.kept} == {PRINTED, DERIVED, UPPER}


BOUND = 'Bound("b", 1.0, "below", 2.0, "", "")'


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("return (1.0, 2.0)", "it must return an Assessment, not (1.0, 2.0)"),
        ("return None", "it must return an Assessment, not None"),
        ("return Assessment(1.0)", "'bounds' must be a tuple, not 1.0"),
        ("return Assessment((1.0,))", "'bounds' must hold Bound, not 1.0"),
        (f"return Assessment(({BOUND},), (3,))", "'unknown' must hold str, not 3"),
        (f"return Assessment(({BOUND},), note=3)", "'note' must be text, not 3"),
        (
            f"return Assessment(({BOUND}._replace(value=np.ones(3)),))",
            "bound 'b': 'value' must be one number, not an arra",
        ),
        (f"return Assessment(({BOUND}._replace(limit='2'),))", "bound 'b': 'limit' must be one number, not '2'"),
        (f"return Assessment(({BOUND}._replace(value=[1, [2]]),))", "'value' must be one number, not [1, [2]]"),
        (f"return Assessment(({BOUND}._replace(value=np.nan),))", "bound 'b': 'value' is not a number"),
        (f"return Assessment(({BOUND}._replace(must='under'),))", "'must' is 'under'; it must be 'below' or 'above'"),
        (
            f"return Assessment(({BOUND}._replace(about='gain'),))",
            "'about' must be keys, such as ('gain',), not 'gain'",
        ),
        (f"return Assessment(({BOUND}._replace(recorded_as='age'),))", "'recorded_as' is 'age'; it must be"),
        (
            f"return Assessment(({BOUND}._replace(recorded_as='command_age'),))",
            "'unit' is ''; a command_age is recorded in",
        ),
        (f"return Assessment(({BOUND}._replace(warning=None),))", "bound 'b': 'warning' must be text, not None"),
    ],
)
def test_what_a_users_law_says_wrong_is_an_error_with_its_place(tmp_path: Path, body: str, words: str) -> None:
    path = with_hook(tmp_path, f"    def assess(self, setting):\n        {body}\n")
    experiment = load(path)
    place = r"mine\.yaml:29:\d+: controller 'mine': \S*/my_controller\.py:4\d: assess: "
    with pytest.raises(ExperimentError, match=place) as e:
        assess(experiment, plan(experiment))
    assert words in str(e.value)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("return setting.missing", "{line}: AttributeError: 'Setting' object has no attribute 'missing'"),
        ("return np.linalg.inv(np.zeros((2, 2)))", "Singular matrix ({line})"),
        ("raise ValueError('the gain is odd')", "the gain is odd ({line})"),
        ("raise SystemExit(3)", "{line}: sys.exit(3) was called"),
    ],
)
def test_what_goes_wrong_in_a_users_law_names_its_line(tmp_path: Path, body: str, words: str) -> None:
    path = with_hook(tmp_path, f"    def assess(self, setting):\n        {body}\n")
    experiment, source = load(path), (tmp_path / "my_controller.py").read_text().splitlines()
    line = next(i for i, text in enumerate(source, 1) if text.strip() == body)
    with pytest.raises(ExperimentError, match=r"mine\.yaml:29:\d+: controller 'mine': ") as caught:
        assess(experiment, plan(experiment))
    assert str(caught.value).endswith(words.format(line=f"{tmp_path / 'my_controller.py'}:{line}"))


def test_a_controller_without_the_hook_is_not_asked() -> None:
    experiment = load(EXPERIMENTS / "my_controller.yaml")
    assert assess(experiment, plan(experiment)).controllers == {}


def test_the_hook_sees_numbers_that_numpy_made_as_numbers(tmp_path: Path) -> None:
    body = f"return Assessment([{BOUND}._replace(value=np.float32(0.5), limit=np.array([3]))])"
    experiment = load(with_hook(tmp_path, f"    def assess(self, setting):\n        {body}\n"))
    (bound,) = assess(experiment, plan(experiment)).controllers["mine"].bounds
    assert (type(bound.value), bound.value, bound.limit) == (float, 0.5, 3.0)
