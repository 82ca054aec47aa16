"""The rules as pytest tests."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

from hilrig.core.errors import PluginError
from hilrig.kinds.registry import is_path, kind_names, load_kind
from hilrig.testing.rule import FIRST, RULES, NotApplicableError, Rule
from hilrig.testing.rules import register_all
from hilrig.testing.subject import TABLE, Subject, subject_of
from hilrig.testing.values import check_values

register_all()


def contract(group: str, *names: str | Path, file_text: str = TABLE, **values: Any) -> Callable[..., None]:
    """Return a test function with one test for each rule that kinds of `group` must keep.

    `names` are kinds, or paths of Python files relative to the folder of the calling file; without names, every
    installed kind of the group is tested. `values` go to the fields of these names: those without a default, or those
    whose default has no effect (a disturbance of 0 N). They are read as an experiment file reads them ("3 N/m",
    {"kind": "./my_robot.py"}); what a file cannot hold is taken as it is. `file_text` is the content of the file that a
    reference reads.

    Raises PluginError if there is no such group, TypeError for a value whose name is not a field of any of the kinds,
    and ValueError for one that a file could not give it.
    """
    base = Path(sys._getframe(1).f_globals.get("__file__", "")).absolute().parent
    cases = [
        pytest.param(kind, rule, id=f"{kind.id}-{name}")
        for kind in choose(base, group, names or kind_names(group), values, file_text)
        for name, rule in rules_of(group).items()
    ]

    @pytest.mark.parametrize(("kind", "rule"), cases)
    def test(kind: Chosen, rule: Rule | None) -> None:
        look(kind, rule)

    return test


def rules_of(group: str) -> dict[str, Rule | None]:
    """Return the rules of a group by name; that it can be loaded and made comes first, and is None."""
    return {"is_a_kind": None, **{rule.name: rule for rule in RULES[group]}}


def look(kind: Chosen, rule: Rule | None) -> None:
    """Fail with a sentence, or skip with a reason, unless a kind keeps a rule."""
    if kind.why_not:
        if rule is None:
            pytest.fail(kind.why_not, pytrace=False)
        pytest.skip(f"{kind.name}: no instance of it can be made")
    if rule is not None:
        if rule.first and kind.does_not_run:
            pytest.skip(f"{kind.subject.name}: mend {rule.first.name} first")
        try:
            sentence = rule.judge(kind.subject)
        except NotApplicableError as reason:
            pytest.skip(str(reason))
        if sentence:
            pytest.fail(sentence, pytrace=False)


def choose(
    base: Path, group: str, names: Iterable[str | Path], values: Mapping[str, Any], file_text: str = TABLE
) -> list[Chosen]:
    """Return kinds that are to be tested, with relative paths from the folder `base`. Raises as `contract` does."""
    chosen = [Chosen(group, str(name), base, values, file_text) for name in names]
    check_values(group, [kind.cls for kind in chosen if kind.cls is not None], values, base)
    return chosen


@dataclass(frozen=True)
class Chosen:
    """A kind to be tested; it is created at first use."""

    group: str
    name: str
    base: Path
    values: Mapping[str, Any]
    file_text: str

    @property
    def id(self) -> str:
        """The name of the kind in test names."""
        return Path(self.name).stem if is_path(self.name) else self.name

    @cached_property
    def cls(self) -> type | None:
        """The class of the kind, or None if it cannot be loaded."""
        with suppress(PluginError):
            return load_kind(self.group, self.name, self.base)
        return None

    @cached_property
    def why_not(self) -> str:
        """Why the kind cannot be tested, in a sentence; empty if it can."""
        try:
            _ = self.subject
        except PluginError as error:
            return f"this kind of {self.group} cannot be loaded: {error}"
        except (TypeError, ValueError) as error:
            return f"{self.name}: the test must be able to create one, but {error}"
        return ""

    @cached_property
    def does_not_run(self) -> bool:
        """Whether it breaks the first rule of its group."""
        try:
            return bool(FIRST[self.group].judge(self.subject))
        except NotApplicableError:
            return False

    @cached_property
    def subject(self) -> Subject:
        """The kind with its instances."""
        return subject_of(self.group, self.name, self.base, self.values, self.file_text)
