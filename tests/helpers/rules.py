"""Which rules of `hilrig.testing` a kind breaks, for tests that break one on purpose."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from hilrig.testing.contract import choose, look, rules_of
from hilrig.testing.rule import RULES, NotApplicableError
from hilrig.testing.rules import register_all
from hilrig.testing.subject import subject_of

register_all()


def broken(group: str, source: str, folder: Path, only: str = "", **values: Any) -> dict[str, str]:
    """Write a kind into `folder` and return the sentence about each rule that it breaks, by the rule's name.

    `only` names one rule, the only one to be looked at.
    """
    (folder / "mine.py").write_text(source)
    subject = subject_of(group, "./mine.py", folder, values)
    found: dict[str, str] = {}
    for rule in (rule for rule in RULES[group] if only in ("", rule.name)):
        try:
            if sentence := rule.judge(subject):
                found[rule.name] = sentence
        except NotApplicableError:
            pass
    return found


def changed(source: str, **replacements: str) -> str:
    """Return `source` with each place {name} of it filled; those that are not given are filled with nothing."""
    for name, text in replacements.items():
        place = f"# {name}"
        assert place in source, f"there is no place '{place}'"
        source = source.replace(place, text)
    return source


def assert_noticed(group: str, source: str, folder: Path, rule: str, words: str, **values: Any) -> None:
    """Check that a kind breaks this rule, and that the sentence about it has these words."""
    assert rule in {known.name for known in RULES[group]}, f"there is no rule {rule}"
    sentence = broken(group, source, folder, rule, **values).get(rule, "it was not noticed")
    assert sentence.startswith("mine.py"), sentence
    assert ", but " in sentence, sentence
    assert words in sentence, sentence
    assert "\n" not in sentence, sentence


def assert_the_first_rule_alone(group: str, source: str, folder: Path, first: str, words: str, **values: Any) -> None:
    """Check that a kind fails its first rule with these words, and that those after it are skipped for one reason."""
    (folder / "mine.py").write_text(source)
    (kind,) = choose(folder, group, ["./mine.py"], values)
    failed: dict[str, str] = {}
    skipped: dict[str, str] = {}
    for name, rule in rules_of(group).items():
        try:
            look(kind, rule)
        except pytest.fail.Exception as failure:
            failed[name] = str(failure)
        except pytest.skip.Exception as reason:
            skipped[name] = str(reason)
    assert list(failed) == [first]
    assert words in failed[first]
    assert set(skipped.values()) == {f"mine.py: mend {first} first"}
    assert list(rules_of(group))[-len(skipped) :] == list(skipped)
    assert list(rules_of(group))[-len(skipped) - 1] == first
