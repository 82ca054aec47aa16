"""The two ways to run the rules: a test file of two lines, and a command. Both in processes of their own."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.patience import PATIENCE

from hilrig.core.errors import HilrigError, PluginError
from hilrig.testing import contract
from hilrig.testing.__main__ import main

KIND = '''
"""A metric of somebody's own."""
from dataclasses import dataclass
from typing import Annotated, ClassVar
import numpy as np
from hilrig import Parameter

@dataclass(frozen=True)
class Mine:
    """top = the largest torque"""

    unit: ClassVar[str] = "N m"
    scale: Annotated[float, Parameter("", "factor", 0.0, 10.0)] = 1.0

    def measure(self, record):
        return {"": self.scale * float(np.max(np.abs(record.torque)))}
'''
SENTENCE = (
    "mine.py: A phase with one tick, a few, or none must not be an error: a trial may trip at once, "
    "but with 0 ticks it raised ValueError: zero-size array to reduction operation maximum which has no identity"
)


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "kinds").mkdir()
    (tmp_path / "kinds" / "mine.py").write_text(KIND)
    return tmp_path


def test_two_lines_make_a_test_of_each_rule_and_a_failure_is_one_sentence(folder: Path) -> None:
    """The path starts from the file's folder, wherever pytest is called."""
    lines = 'from hilrig.testing import contract\n\ntest_mine = contract("metrics", "mine.py")\n'
    (folder / "kinds" / "test_mine.py").write_text(lines)
    done = run(folder, "pytest", "-v", "kinds/test_mine.py")
    assert done.returncode == 1, done.stderr
    assert "test_mine.py::test_mine[mine-is_a_kind] PASSED" in done.stdout
    assert "test_mine.py::test_mine[mine-the_record_is_only_read] PASSED" in done.stdout
    failures = done.stdout.split("= FAILURES =")[1].split("= short test summary")[0]
    told = [line for line in failures.splitlines() if line and set(line[:3]) not in ({"="}, {"_"})]
    assert len(told) == 1
    assert told[0].startswith(SENTENCE)
    assert re.search(r"\b1 failed, 1\d passed", done.stdout)


def test_the_command_does_the_same_and_passes_options_on(folder: Path) -> None:
    (folder / "pytest.ini").write_text("[pytest]\naddopts = --no-such-option\n")
    call = ("hilrig.testing", "metrics", "kinds/mine.py", "scale=2", "-q", "-k", "few_ticks")
    done = run(folder, *call, "--junit-xml=result.xml")
    assert done.returncode == 1, done.stderr
    assert SENTENCE in done.stdout
    assert "1 failed, " in done.stdout
    assert SENTENCE in (folder / "result.xml").read_text()
    assert sorted(path.name for path in folder.iterdir()) == ["kinds", "pytest.ini", "result.xml"]


def test_a_wrong_call_says_what_is_wrong(folder: Path) -> None:
    done = run(folder, "hilrig.testing", "metric", "./kinds/mine.py")
    assert done.returncode == 2
    assert done.stderr.startswith("there is no group 'metric'; did you mean 'metrics'?")
    done = run(folder, "hilrig.testing", "references", "scale=2", "-q")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("name a kind of references (csv, hold, ")
    done = run(folder, "hilrig.testing")
    assert done.returncode == 2
    assert "GROUP" in done.stdout


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("scael=2",), "there is no field 'scael' of metrics; did you mean 'scale'? (fields: scale)"),
        (("scale=2 N",), "scale: '2 N' is a force [N]; this needs a pure number"),
        (("scale=20",), "scale: 20 is not allowed; this needs a pure number, e.g. '0.5' (from 0 to 10)"),
        (("scale={2",), "scale={2:1:3: is not YAML: "),
        (("nope",), "'nope' is no kind of metrics (known: auxiliary_error_rmse, "),
        (("efort",), "'efort' is no kind of metrics; did you mean 'effort'? (known: "),
        (("kinds/nope.py",), "there is no file kinds/nope.py"),
    ],
)
def test_a_word_that_says_nothing_is_one_sentence(
    folder: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], sentence: str
) -> None:
    monkeypatch.chdir(folder)
    with pytest.raises(HilrigError) as caught:
        main(["metrics", "./kinds/mine.py", *words])
    assert str(caught.value).startswith(sentence)


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("scale=2 N", "scale: '2 N' is a force [N]; this needs a pure number, e.g. '0.5'\n"),
        ("scale=[2", "scale=[2:1:3: is not YAML: expected ',' or ']', but got '<stream end>', "
                     "while parsing a flow sequence\n"),
    ],
)  # fmt: skip
def test_the_command_shows_that_sentence_alone(folder: Path, word: str, sentence: str) -> None:
    done = run(folder, "hilrig.testing", "metrics", "./kinds/mine.py", word)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", sentence)


def test_a_test_is_shown_as_its_kind_and_its_rule(folder: Path) -> None:
    done = run(folder, "hilrig.testing", "metrics", "./kinds/mine.py", "effort", "-v", "--tb=no")
    assert "\nFAILED kinds/mine.py::a_record_of_few_ticks_is_no_error - " in done.stdout
    assert "\nkinds/mine.py::is_a_kind PASSED" in done.stdout
    assert "\neffort::lower_is_better PASSED" in done.stdout
    assert "tmp" not in done.stdout
    done = run(folder, "hilrig.testing", "metrics", str(folder / "kinds" / "mine.py"), "-q")
    assert "\nFAILED mine.py::a_record_of_few_ticks_is_no_error - " in done.stdout
    done = run(folder / "kinds", "hilrig.testing", "metrics", "../kinds/mine.py", "-q")
    assert re.search(r"\nFAILED (../kinds/)?mine.py::a_record_of_few_ticks_is_no_error - ", done.stdout)


def test_workers_that_would_not_know_the_rules_are_refused(folder: Path) -> None:
    done = run(folder, "hilrig.testing", "metrics", "effort", "-n", "2")
    assert done.returncode == 4
    assert "unrecognized arguments: -n" in done.stderr


def test_the_command_says_why_rules_are_skipped(folder: Path) -> None:
    (folder / "kinds" / "mine.py").write_text("import numpy\nraise RuntimeError('no idea')\n")
    done = run(folder, "hilrig.testing", "metrics", "kinds/mine.py", "-q")
    assert re.search(r"^SKIPPED 1\d rules: kinds/mine.py: no instance of it can be made$", done.stdout, re.MULTILINE)


def test_a_kind_that_cannot_be_loaded_is_one_failure(folder: Path) -> None:
    (folder / "kinds" / "mine.py").write_text("import numpy\nraise RuntimeError('no idea')\n")
    done = run(folder, "hilrig.testing", "metrics", "./kinds/mine.py")
    assert done.returncode == 1
    assert re.search(r"\b1 failed, \d+ skipped", done.stdout)
    assert "this kind of metrics cannot be loaded:" in done.stdout
    assert "mine.py:2: RuntimeError: no idea" in done.stdout


def test_a_value_that_no_kind_takes_is_refused() -> None:
    with pytest.raises(TypeError, match=r"there is no field 'bnad' of metrics; did you mean 'band'\?"):
        contract("metrics", bnad=0.1)


def test_a_group_that_is_not_there_is_refused() -> None:
    with pytest.raises(PluginError, match="there is no group of kinds 'metric'; did you mean 'metrics'"):
        contract("metric")


def test_without_pytest_the_message_says_how_to_get_it(tmp_path: Path) -> None:
    call = "import sys; sys.modules['pytest'] = None; import hilrig.testing"
    done = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert "hilrig.testing needs pytest: uv add --editable 'PATH/TO/hilrig[test]'" in done.stderr
