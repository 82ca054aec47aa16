"""The JSON Schema is judged by another reader of such schemas, not by ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from helpers.experiment_files import GOOD
from jsonschema import Draft202012Validator

from hilrig.experiment import document, experiment_schema
from hilrig.experiment.schema import json_schema
from hilrig.study.model import Study

FOLDER = Path(__file__).parents[3] / "experiments"
STUDIES = [FOLDER / "paper" / "reproduce.yaml"]
EXPERIMENTS = sorted(path for path in FOLDER.glob("**/*.yaml") if path not in STUDIES)


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    schema = json.loads(json.dumps(experiment_schema(), allow_nan=False))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def errors(validator: Draft202012Validator, data: Any) -> list[str]:
    return [f"{list(error.absolute_path)}: {error.message[:200]}" for error in validator.iter_errors(data)]


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_it_takes_every_experiment_that_ships(validator: Draft202012Validator, path: Path) -> None:
    assert errors(validator, document.read_document(path).data) == []


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_a_studys_takes_every_study_that_ships(path: Path) -> None:
    schema = json_schema(Study)
    Draft202012Validator.check_schema(schema)
    assert errors(Draft202012Validator(schema), document.read_document(path).data) == []


def test_it_takes_a_controller_in_a_file_of_the_users(validator: Draft202012Validator) -> None:
    text = GOOD.replace("{kind: pd}", "{kind: ./mine.py, gain: 3}")
    assert errors(validator, document.parse(text, "").data) == []


REFUSED = {
    "unknown key": ("period:", "perod:"),
    "unknown parameter": ("{kind: pd}", "{kind: pd, stifness: 3}"),
    "unknown nested key": ("stiffness: 800", "stifness: 800"),
    "missing key": ("question: What is wrong?\n", ""),
    "missing parameter": ("frequency: 1 rad/s", "phase: 0"),
    "missing kind": ("{kind: pd}", "{stiffness: 3}"),
    "unknown kind": ("{kind: pd}", "{kind: pdd}"),
    "kind of another group": ("{kind: pd}", "{kind: sine}"),
    "beyond its bound": ("period: 1 ms", "period: 1"),
    "too few": ("[0.345 m, 0.2 m]", "[0.345 m]"),
    "one for a list": ("[z]", "z"),
    "choice": ("period: 1 ms", "clock: real_time"),
    "not whole": ("period: 1 ms", "repeats: 1.5"),
    "text for a switch": ("stiffness: 800 N/m", "pulls: 'yes'"),
    "version": ("hilrig: 1", "hilrig: 2"),
}


@pytest.mark.parametrize(("old", "new"), REFUSED.values(), ids=REFUSED)
def test_it_refuses_what_check_refuses(validator: Draft202012Validator, old: str, new: str) -> None:
    assert old in GOOD
    assert errors(validator, document.parse(GOOD.replace(old, new, 1), "").data) != []
