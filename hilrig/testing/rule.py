"""Rules: functions that check a kind and raise `Broken` if the kind breaks the rule."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, TypeVar

import numpy as np

from hilrig.core.errors import describe_error, raised
from hilrig.kinds.registry import PROTOCOLS
from hilrig.testing.subject import Subject

Check = TypeVar("Check", bound=Callable[[Any], None])

GROUPS = tuple(PROTOCOLS)


class Broken(Exception):
    """A rule is broken. The message says what the kind did, as the end of a sentence: "it returned ..."."""


class NotApplicableError(Exception):
    """A rule does not apply to this kind. The message says why."""


class Rule(NamedTuple):
    """One rule of a group."""

    name: str
    """In words, with underscores: it names the test"""
    sentence: str
    """The requirement"""
    check: Callable[[Any], None]
    """Raises Broken or NotApplicableError; any other error comes from the kind"""
    whole: bool
    """Whether `check` takes the Subject, rather than each of its variants in turn"""
    first: Rule | None
    """The rule that must be kept before this one is looked at, if there is one"""

    def judge(self, subject: Subject) -> str:
        """Return one sentence on how `subject` breaks the rule; empty if it keeps it. Raises NotApplicableError."""
        silent: list[NotApplicableError] = []
        looked_at = [subject] if self.whole else subject.variants
        for variant in looked_at:
            try:
                self.check(variant)
            except NotApplicableError as reason:
                silent.append(reason)
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # a kind may end the program, too
                choice = "" if self.whole else subject.choice(variant)
                return f"{subject.name}{choice}: {self.sentence}, but {_told(error, subject)}"
        if len(silent) == len(looked_at):
            raise silent[0]
        return ""


RULES: dict[str, list[Rule]] = {group: [] for group in GROUPS}
"""The rules of each group, in the order in which they are checked"""


FIRST: dict[str, Rule] = {}
"""The rule of each group without which those after it say nothing, once it is known: the kind runs at all"""


def rule(*groups: str, whole: bool = False, first: bool = False) -> Callable[[Check], Check]:
    """Make a function a rule of these groups: its name names the test, the first line of its docstring is the rule.

    It is called with each variant of a kind, or once with the Subject if `whole`. For a kind that breaks the `first`
    rule of its group, the rules after it are not called.
    """

    def register(check: Check) -> Check:
        sentence = (inspect.getdoc(check) or "").split("\n")[0].rstrip(".")
        for group in groups:
            made = Rule(check.__name__, sentence, check, whole, FIRST.get(group))
            RULES[group].append(made)
            if first:
                FIRST[group] = made
        return check

    return register


def require(condition: Any, what: str, *values: Any) -> None:
    """Raise Broken with `what` the kind did, unless the condition holds; each {} in it stands for one of `values`."""
    if not condition:
        raise Broken(what.format(*_told_apart(values)) if values else what)


def _told_apart(values: Sequence[Any]) -> list[str]:
    """Return the texts of values, with as many digits as it takes to tell them apart."""
    texts: list[str] = []
    for digits in (6, 9, 12, 17):
        texts = [shown(value, digits) for value in values]
        if len(set(texts)) == len(texts):
            break
    return texts


@contextmanager
def noting(where: str) -> Iterator[None]:
    """Add a note to an error of the kind that says where it occurred: "on 3 axes it raised ..."."""
    try:
        yield
    except Broken:
        raise
    except Exception as error:
        error.add_note(where)
        raise


def same(one: Any, other: Any) -> bool:
    """Return whether two arrays, or numbers, are equal to the last bit."""
    first, second = np.asarray(one), np.asarray(other)
    return first.shape == second.shape and first.dtype == second.dtype and first.tobytes() == second.tobytes()


def shown(value: Any, digits: int = 6) -> str:
    """Return the text of an array, a number or a word for a message."""
    if isinstance(value, (str, int)):
        return str(value)
    array = np.asarray(value)
    if array.size > 12:
        return f"an array {array.shape}"
    return f"[{', '.join(shown(part, digits) for part in array)}]" if array.ndim else f"{array:.{digits}g}"


def _told(error: BaseException, subject: Subject) -> str:
    """Return what the kind did, with the line of its file if it raised an error."""
    if isinstance(error, Broken):
        return str(error)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == subject.file]
    what = f"{raised(error)} (line {frames[-1].lineno})" if frames else describe_error(error)
    return " ".join([*getattr(error, "__notes__", ()), f"it raised {what}"])
