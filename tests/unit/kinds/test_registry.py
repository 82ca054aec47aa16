from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.packages import offer

from hilrig.core.errors import PluginError
from hilrig.core.parameters import plain
from hilrig.kinds import registry as plugins
from hilrig.kinds.contact import Surface
from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.references.min_jerk import MinJerk

CONTROLLER = '''
from dataclasses import dataclass

@dataclass(frozen=True)
class Mine:
    """tau = 0."""

    gain: float = {gain}
    pair: tuple[float, float] = (0.1, 0.2)

    def start(self, task, state):
        raise NotImplementedError

class Helper:
    """Not a dataclass, so not the kind."""
'''


def test_built_in_kinds_are_the_files() -> None:
    assert plugins.kind_names("references") == ("csv", "hold", "min_jerk", "sine", "waypoints")
    assert plugins.load_kind("controllers", "pd") is Pd


def test_entry_points_are_found() -> None:
    assert {"two_link", "pybullet_arm"} <= set(plugins.kind_names("drivers"))
    assert plugins.name_of(plugins.load_kind("drivers", "two_link")) == ("drivers", "two_link")


@pytest.mark.parametrize("group", [group for group in plugins.PROTOCOLS if group != "drivers"])
def test_every_kind_loads_and_knows_its_name(group: str) -> None:
    for kind in plugins.kind_names(group):
        assert plugins.name_of(plugins.load_kind(group, kind)) == (group, kind)


@pytest.mark.parametrize(
    ("group", "entry", "words"),
    [
        ("drivers", "two_link = other.two_link", "two packages offer the kind 'two_link' of drivers"),
        ("controllers", "pd = other.pd", "'pd' of controllers, which is built into hilrig"),
    ],
)
def test_two_packages_cannot_offer_the_same_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, group: str, entry: str, words: str
) -> None:
    offer(tmp_path, monkeypatch, group, entry)
    with pytest.raises(PluginError, match=words):
        plugins.kind_names(group)


def test_a_package_that_is_installed_twice_is_no_clash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = plugins.kind_names("drivers")
    offer(tmp_path, monkeypatch, "drivers", "two_link = hilrig_drivers.two_link")
    assert plugins.kind_names("drivers") == before


def test_an_unknown_kind_names_the_choices_and_the_nearest() -> None:
    with pytest.raises(PluginError, match=r"no kind 'sin' of references; did you mean 'sine'\? \(known: csv, hold"):
        plugins.load_kind("references", "sin")


def test_an_unknown_group_names_the_nearest() -> None:
    with pytest.raises(PluginError, match="did you mean 'controllers'"):
        plugins.kind_names("controler")


def test_parameters_survive_dump_and_restore_exactly() -> None:
    third = Pd(stiffness=(0.1 + 0.2, 1 / 3), damping=2.0**-60)
    document = json.loads(json.dumps(plugins.dump(third)))
    assert document["kind"] == "pd"
    assert plugins.restore("controllers", document) == third


def test_nested_kinds_and_parts_survive() -> None:
    driver = plugins.load_kind("drivers", "two_link")
    robot = plugins.load_kind("robots", "planar_2r")(lengths=(0.3, 0.2), masses=(1.0, 1.0), dynamic_lengths=(1.0, 2.0))
    made = driver(robot=robot, surface=Surface(0.3, pulls=True))
    document = plugins.dump(made)
    assert document["robot"]["kind"] == "planar_2r"
    assert "kind" not in document["surface"]
    assert plugins.restore("drivers", json.loads(json.dumps(document))) == made


def test_none_survives() -> None:
    move = MinJerk(end=1.0)
    assert plugins.restore("references", plugins.dump(move)) == move


def test_a_document_with_an_unknown_parameter_is_refused() -> None:
    with pytest.raises(PluginError, match="no parameter 'stifness'; did you mean 'stiffness'"):
        plugins.restore("controllers", {"kind": "pd", "stifness": 1.0})


def test_a_document_without_a_needed_parameter_is_refused() -> None:
    with pytest.raises(PluginError, match="MinJerk needs the parameter 'end'"):
        plugins.restore("references", {"kind": "min_jerk"})


PARTS = """
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
import numpy as np
from hilrig import PerAxis

@dataclass(frozen=True)
class _Part:
    a: PerAxis = (1.0, np.inf)

@dataclass(frozen=True)
class Mine:
    number: Any = 1.0
    largest: float | None = np.inf
    least: tuple[float, ...] = (-np.inf, 0.0)
    word: str = "inf"
    gains: Mapping[str, float] = field(default_factory=lambda: {"x": np.inf})
    part: _Part = field(default_factory=_Part)
    parts: tuple[_Part, ...] = (_Part(), _Part(3.0))
    made: float = field(init=False, default=2.0)

    def start(self, task, state):
        raise NotImplementedError
"""


def test_infinities_mappings_and_parts_survive(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(PARTS)
    made = plugins.load_kind("controllers", "./mine.py", tmp_path)()
    text = json.dumps(plugins.dump(made), allow_nan=False)
    assert plugins.restore("controllers", json.loads(text)) == made


NUMBERS = [
    np.float32(0.5),
    np.float64(0.5),
    np.int64(3),
    np.bool_(True),
    np.str_("x"),
    np.array(0.5),
    np.array([1.0, 2]),
]


@pytest.mark.parametrize("value", NUMBERS, ids=repr)
def test_numpys_values_are_written_as_pythons(tmp_path: Path, value: Any) -> None:
    (tmp_path / "mine.py").write_text(PARTS)
    cls = plugins.load_kind("controllers", "./mine.py", tmp_path)
    document = json.loads(json.dumps(plugins.dump(cls(number=value))))
    assert document["number"] == value.tolist()
    assert plugins.restore("controllers", document) == cls(number=plain(value))


@pytest.mark.parametrize(("value", "words"), [(float("nan"), "'number' is NaN"), (1j, "'number' is a complex")])
def test_what_cannot_be_written_is_refused_by_name(tmp_path: Path, value: Any, words: str) -> None:
    (tmp_path / "mine.py").write_text(PARTS)
    made = plugins.load_kind("controllers", "./mine.py", tmp_path)(number=value)
    with pytest.raises(PluginError, match=words):
        plugins.dump(made)


@pytest.mark.parametrize("document", [{}, {"kind": 3.0}])
def test_a_document_without_a_kind_is_refused(document: dict[str, Any]) -> None:
    with pytest.raises(PluginError, match="a record of one of the controllers does not name its kind"):
        plugins.restore("controllers", document)


def test_a_users_file_is_found_from_the_experiments_folder(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(CONTROLLER.format(gain=1.0))
    cls = plugins.load_kind("controllers", "./mine.py", tmp_path)
    document = plugins.dump(cls(gain=3.0))
    assert document["kind"] == str(tmp_path / "mine.py")
    assert plugins.restore("controllers", document) == cls(gain=3.0)


def test_the_same_file_is_the_same_class_and_a_changed_one_is_not(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(CONTROLLER.format(gain=1.0))
    first = plugins.load_kind("controllers", str(path))
    assert plugins.load_kind("controllers", "mine.py", tmp_path) is first
    path.write_text(CONTROLLER.format(gain=2.0))
    assert plugins.load_kind("controllers", str(path))().gain == 2.0


def test_restoring_needs_no_heavy_import() -> None:
    code = (
        "import sys; from hilrig.kinds import registry as plugins; from hilrig.experiment import trial\n"
        "plugins.restore('references', {'kind': 'hold', 'value': 1.0})\n"
        "heavy = ('pint', 'ruamel.yaml', 'matplotlib', 'pandas')\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_a_kind_that_cannot_be_loaded_does_not_hide_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offer(tmp_path, monkeypatch, "metrics", "theirs = no_such_module")
    found, failed = plugins.load_kinds("metrics")
    assert {"force_rmse", "effort"} <= set(found)
    assert list(failed) == ["theirs"]
    assert "'theirs' of metrics cannot be imported: ModuleNotFoundError" in failed["theirs"]
