"""The values that an author gives to test with are read as an experiment file reads them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from helpers.builders import arm
from helpers.patience import PATIENCE
from hilrig_drivers.two_link import TwoLink

from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.references.sine import Sine
from hilrig.testing.values import read_values

ROBOT = '''
"""A robot of somebody's own."""
from dataclasses import dataclass
from hilrig.kinds.robots.planar_2r import Planar2r

@dataclass(frozen=True)
class Longarm(Planar2r):
    """x = l1 cos q1 + l2 cos(q1 + q2)"""
'''
DRIVER = '''
"""A driver of somebody's own, for a robot of his own."""
from dataclasses import dataclass
from typing import ClassVar
from hilrig import Capabilities, Robot

@dataclass(frozen=True)
class Mine:
    """The arm in the cellar"""

    capabilities: ClassVar[Capabilities] = Capabilities(("realtime",), (), simulated=False, stop_time=1.0)
    surface_position: ClassVar[float] = 0.3
    servo_gain: ClassVar[None] = None
    robot: Robot

    def __post_init__(self):
        if type(self.robot).__name__ != "Longarm":
            raise ValueError(f"it drives no {type(self.robot).__name__}")

    def connect(self, start) -> "Arm":
        raise AssertionError("nobody moves it")


class Arm:
    def no(self, *_):
        raise AssertionError("nobody moves it")

    measure = advance = holding_command = truth = hold = close = no
'''


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mine.py").write_text(DRIVER)
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "longarm.py").write_text(ROBOT)
    return tmp_path


def passed(folder: Path, *arguments: str) -> int:
    """Return how many rules pass; none must fail."""
    command = [sys.executable, "-m", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return int(done.stdout.split(" passed")[0].split()[-1])


def test_a_driver_is_tested_with_a_robot_of_its_own(folder: Path) -> None:
    robot = "robot={kind: robots/longarm.py, lengths: [1 m, 80 cm], masses: [1, 1]}"
    assert passed(folder, "hilrig.testing", "drivers", "mine.py", robot, "-q") >= 8


def test_so_it_is_in_a_file_of_tests_from_its_folder(folder: Path, tmp_path: Path) -> None:
    robot = "dict(kind='robots/longarm.py', lengths=['1 m', '80 cm'], masses=[1, 1])"
    call = f"contract('drivers', 'mine.py', robot={robot})"
    (folder / "test_mine.py").write_text(f"from hilrig.testing import contract\n\ntest_mine = {call}\n")
    (tmp_path / "elsewhere").mkdir()
    assert passed(tmp_path / "elsewhere", "pytest", "-q", "../test_mine.py") >= 8


@pytest.mark.parametrize(
    ("cls", "name", "value", "read"),
    [
        (Pd, "stiffness", "3 N/mm", 3000.0),
        (Pd, "stiffness", ["3 N/mm", 20], (3000.0, 20.0)),
        (Pd, "stiffness", (3.0, 20.0), (3.0, 20.0)),
        (Pd, "stiffness", 7, 7.0),
        (Sine, "amplitude", "3 cm", 0.03),
        (Sine, "amplitude", "3 N", 3.0),
        (TwoLink, "robot", arm(), arm()),
    ],
)
def test_a_value_is_read_as_in_a_file_or_taken_as_it_is(cls: type, name: str, value: Any, read: Any) -> None:
    assert read_values(cls, {name: value, "other": 1}, Path()) == {name: read}


@pytest.mark.parametrize(
    ("cls", "values", "sentence"),
    [
        (Pd, {"stiffness": "3 s"}, "stiffness: '3 s' is a time [s]; this needs a stiffness, e.g. '800 N/m'"),
        (Sine, {"amplitude": "3 s"}, "amplitude: '3 s' is a time [s]; this needs a length, e.g. '0.1 m'"),
        (TwoLink, {"robot": "./mine.py"}, "robot: './mine.py' is not a mapping with 'kind', such as {kind: ./mine.py}"),
        (TwoLink, {"surface": {"position": "1 kg"}}, "surface.position: '1 kg' is a mass [kg]; this needs a "),
    ],
)
def test_a_value_that_a_file_could_not_give_is_refused(cls: type, values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=r"^\w") as caught:
        read_values(cls, values, Path())
    assert str(caught.value).startswith(sentence)
