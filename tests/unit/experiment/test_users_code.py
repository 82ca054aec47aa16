"""Whatever goes wrong in a file of the user's: one message with the experiment's line, and the file's name and line."""

# ruff: noqa: E501  (one case, one line)

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from helpers.experiment_files import GOOD, POSITION, broken_file, problems_of

from hilrig.core.errors import ExperimentError
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.experiment.schema import describe_kind
from hilrig.experiment.trial import Trial

KIND = """
from __future__ import annotations
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple
import sys
import numpy as np
from hilrig import Law, Parameter

class Memory(NamedTuple):
    Kp: np.ndarray
    time: np.ndarray

@dataclass(frozen=True)
class Mine:
    gain: {}

    def start(self, task, state):
        {}
"""
CLASS, FIELD, START = 15, 16, 19
"""Lines of the class, its field, and what `start` does"""
NOTHING = "return Law(lambda *_: np.zeros(2), None, ())"
TO_MEMORY = "return Law(lambda *_: np.zeros(2), None, Memory(np.zeros(1), np.zeros(1)))"


def kind(field: str = "float = 1.0", start: str = NOTHING) -> str:
    return KIND.format(field, start)


HEAD = "from dataclasses import dataclass\n"
BROKEN_FILES = {
    "syntax": ("x = 1\ndef f(:\n", "kind.py:2: invalid syntax"),
    "null character": ("x = 1\n\0", "null bytes"),
    "latin-1": ("x = 1\ny = '\udce9'\n", "kind.py:2: (unicode error) 'utf-8'"),
    "unknown encoding": ("# -*- coding: nonsense -*-\n", "kind.py: unknown encoding: nonsense"),
    "nested too deeply": ("(" * 300, "kind.py:1: too many nested parentheses"),
    "raises": ("x = 1\n\ny = x / 0\n", "kind.py:3: ZeroDivisionError: division by zero"),
    "ends the program": ("import sys\nsys.exit(0)\n", "kind.py:2: sys.exit(0) was called"),
    "raises what few catch": ("raise GeneratorExit\n", "kind.py:1: GeneratorExit"),
    "recursion": ("def f(): return f()\nf()\n", "kind.py:1: RecursionError"),
    "import that fails": ("x = 1\nimport nothing_of_this_name\n", "kind.py:2: ModuleNotFoundError"),
    "import that has moved": ("from hilrig.interfaces import Law\n", "kind.py:1: ModuleNotFoundError: the module hilrig.interfaces has moved"),
    "nothing in it": ("", "exactly one public dataclass; this one has no class"),
    "no dataclass": ("class A: pass\n", "this one has A without @dataclass"),
    "two of them": (HEAD + 2 * "@dataclass(frozen=True)\nclass A: pass\n" + "B = A\n", "this one has A, A"),
    "not frozen": (HEAD + "@dataclass\nclass A: pass\n", "kind.py:3: A is mutable"),
    "lacks start": (HEAD + "@dataclass(frozen=True)\nclass A: pass\n", "kind.py:3: A lacks start"),
    "a parameter called kind": (kind("float = 1.0\n    kind: float = 2.0"), f"kind.py:{FIELD + 1}: a parameter cannot be called 'kind'"),
    "a default that can change": (kind("float = []"), "ValueError: mutable default"),
    "a type that no file can give": (kind("bytes"), f"kind.py:{FIELD}: the type of parameter 'gain' cannot come from a file: bytes; use float"),
    "an array": (kind("np.ndarray"), f"kind.py:{FIELD}: the type of parameter 'gain' cannot come from a file: ndarray"),
    "one of two types": (kind("float | str = 1.0"), f"kind.py:{FIELD}: the type of parameter 'gain' cannot come from a file: float | str"),
    "an annotation that is not there": (kind("Nonsense"), f"kind.py:{FIELD}: the annotation of 'gain' cannot be evaluated: NameError"),
    "an annotation that fails": (kind("np.nonsense"), f"kind.py:{FIELD}: the annotation of 'gain' cannot be evaluated: AttributeError"),
    "a default that is NaN": (kind("float = np.nan"), f"kind.py:{FIELD}: the parameter 'gain' is NaN"),
    "a default that is no number": (kind("float = 1j"), f"kind.py:{FIELD}: the parameter 'gain' is a complex"),
    "a value that changes twice": (
        kind("float = 1.0\n    def __post_init__(self):\n        object.__setattr__(self, 'gain', self.gain * 2)"),
        f"kind.py:{FIELD}: the parameter 'gain' is 2.0 here but would be 4.0 in the processes",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("code", "words"), BROKEN_FILES.values(), ids=BROKEN_FILES)
def test_a_file_that_cannot_be_used_is_named_with_its_line(tmp_path: Path, code: str, words: str) -> None:
    (tmp_path / "kind.py").write_text(code, errors="surrogateescape")
    path, place = broken_file(tmp_path, GOOD.replace("{kind: pd}", "{kind: §./kind.py}"))
    message, error = problems_of(path)
    assert words in message
    assert [problem.place[1:] for problem in error.problems if problem.place] == [place]
    assert "\n" not in message


FAILING_CODE = {
    "default": (kind("float = field(default_factory=lambda: 1 / 0)"), f"kind.py:{FIELD}: ZeroDivisionError"),
    "post_init": (
        kind("float = 1.0\n    def __post_init__(self):\n        raise ValueError('gain is odd')"),
        f"gain is odd ({{folder}}/kind.py:{FIELD + 2})",
    ),
    "start raises": (kind(start="raise RuntimeError('not calibrated')"), f"kind.py:{START}: RuntimeError: not calibrated"),
    "start refuses": (kind(start="raise ValueError('gain is odd')"), f"gain is odd ({{folder}}/kind.py:{START})"),
    "start ends the program": (kind(start="sys.exit(0)"), f"kind.py:{START}: sys.exit(0) was called"),
    "start fails in a library": (kind(start="np.linalg.inv(np.ones((2, 3)))"), f"kind.py:{START})"),
    "start never ends": (kind(start="return self.start(task, state)"), f"kind.py:{START}: RecursionError"),
    "start returns nothing": (kind(start="pass"), "start returned a NoneType; it must return a Law"),
    "start takes too little": (kind().replace("task, state", "task"), f"kind.py:{CLASS}: TypeError: Mine.start() takes 2"),
    "not a ROS 2 name": (kind(start=TO_MEMORY), "kind.py:11: the memory field 'Kp' has a name that ROS 2 does not allow"),
    "names of the record": (kind(start=TO_MEMORY), "kind.py:12: the memory field 'time' has a name that is reserved"),
}  # fmt: skip


@pytest.mark.parametrize(("code", "words"), FAILING_CODE.values(), ids=FAILING_CODE)
def test_code_that_fails_is_named_with_its_line(tmp_path: Path, code: str, words: str) -> None:
    (tmp_path / "kind.py").write_text(code)
    path, place = broken_file(tmp_path, GOOD.replace("{kind: pd}", "§{kind: ./kind.py}"))
    message, error = problems_of(path)
    assert words.replace("{folder}", str(tmp_path)) in message
    assert [problem.place[1:] for problem in error.problems if problem.place] == [place]
    assert "\n" not in message


FAILING_PARTS = {
    "reference": (POSITION, "§{kind: ./kind.py}", "def sample(self, time, span):\n        return {}['x']", "kind.py:7: KeyError: 'x'"),
    "reference of another length": (
        POSITION, "§{kind: ./kind.py}", "def sample(self, time, span):\n        return (0.0, 0.0, 0.0)", "sample must return three arrays of 4001",
    ),
    "reference that is not finite": (
        POSITION, "§{kind: ./kind.py}", "def sample(self, time, span):\n        return (time / 0,) * 3", "arrays of 4001 finite numbers",
    ),
    "disturbance": (
        "{kind: sensor_noise, force: 0.05 N}", "§{kind: ./kind.py}",
        "acts_on = ()\n    def apply(self, schedule, time, axes, random):\n        schedule.nothing", "kind.py:8: AttributeError",
    ),
    "robot": ("{kind: planar_2r", "{kind: ./kind.py", "def inverse_kinematics(self, position):\n        return {}['x']", "kind.py:7: KeyError: 'x'"),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize(("old", "new", "body", "words"), FAILING_PARTS.values(), ids=FAILING_PARTS)
def test_other_kinds_that_fail_are_named_too(tmp_path: Path, old: str, new: str, body: str, words: str) -> None:
    base = "Planar2r" if "kinematics" in body else "object"
    head = HEAD + "from hilrig.kinds.robots.planar_2r import Planar2r\n\n@dataclass(frozen=True)\n"
    (tmp_path / "kind.py").write_text(f"{head}class Mine({base}):\n    {body}\n")
    path, place = broken_file(tmp_path, GOOD.replace(old, new))
    message, error = problems_of(path)
    assert words in message
    assert place is None or place in [problem.place[1:] for problem in error.problems if problem.place]


def test_a_helper_file_that_fails_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "helper_that_fails.py").write_text("x = 1\ny = x / 0\n")
    (tmp_path / "kind.py").write_text("import helper_that_fails\n")
    monkeypatch.syspath_prepend(tmp_path)
    path, _ = broken_file(tmp_path, GOOD.replace("{kind: pd}", "{kind: ./kind.py}"))
    with pytest.raises(ExperimentError, match=r"helper_that_fails\.py:2: ZeroDivisionError"):
        load(path)


def test_ctrl_c_while_a_file_is_loaded_ends_the_program(tmp_path: Path) -> None:
    (tmp_path / "kind.py").write_text("raise KeyboardInterrupt\n")
    path, _ = broken_file(tmp_path, GOOD.replace("{kind: pd}", "{kind: ./kind.py}"))
    with pytest.raises(KeyboardInterrupt):
        load(path)


@pytest.mark.parametrize(
    ("field", "wanted"),
    [
        ("float = np.float32(0.5)", 0.5),
        ("float = field(default_factory=lambda: np.array(0.5))", 0.5),
        ("int = np.int64(3)", 3),
        ("bool = np.bool_(True)", True),
        ("str = np.str_('x')", "x"),
        ("tuple[float, ...] = (np.float32(0.5), 1.0)", (0.5, 1.0)),
        ("float = np.inf", float("inf")),
        ("Mapping[str, float] = field(default_factory=lambda: {'x': -np.inf})", {"x": -float("inf")}),
        ("float = 1.0\n    _gain: float = 2.0", 1.0),
        ("float = 1.0\n    made: float = field(init=False, default=2.0)", 1.0),
    ],
)
def test_a_trials_processes_get_the_defaults_that_were_checked(tmp_path: Path, field: str, wanted: object) -> None:
    (tmp_path / "kind.py").write_text(kind(field))
    path, _ = broken_file(tmp_path, GOOD.replace("{kind: pd}", "{kind: ./kind.py}"))
    (trial,) = plan(load(path))
    for controller in (trial.controller, Trial.from_document(json.loads(json.dumps(trial.to_document()))).controller):
        assert controller.gain == wanted  # pyright: ignore[reportAttributeAccessIssue]
        assert type(controller.gain) is type(wanted)  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(
    "annotation",
    [
        'Annotated[float, Parameter("N/m", "K", 0, 9)] | None',
        'tuple[Annotated[float, Parameter("N/m", "K", 0, 9)], ...]',
    ],
)
def test_a_parameter_within_an_optional_or_a_tuple_keeps_unit_and_bounds(tmp_path: Path, annotation: str) -> None:
    (tmp_path / "kind.py").write_text(kind(f"{annotation} = None"))
    given = "[3 N/m]" if annotation.startswith("tuple") else "3 N/m"
    path, _ = broken_file(tmp_path, GOOD.replace("{kind: pd}", f"{{kind: ./kind.py, gain: {given}}}"))
    controller: Any = load(path).controllers["pd"]
    assert controller.gain in (3.0, (3.0,))
    (row,) = describe_kind("controllers", str(tmp_path / "kind.py"))
    assert (row.unit, row.high) == ("N/m", 9)


def test_a_dataclass_that_has_itself_as_a_part_is_described(tmp_path: Path) -> None:
    (tmp_path / "kind.py").write_text(kind('"Mine" = None'))
    assert [row.name for row in describe_kind("controllers", str(tmp_path / "kind.py"))] == ["gain"]


@pytest.mark.parametrize(
    "line", ["from hilrig import signals", "import hilrig.signals", "from hilrig.signals import State"]
)
def test_every_way_to_import_a_moved_module_is_told_where_it_is(line: str) -> None:
    with pytest.raises(ImportError, match=r"hilrig\.signals has moved: .* `from hilrig import State, Reference`"):
        exec(line)
