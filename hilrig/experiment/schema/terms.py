"""Types of the schema: findings, the context and readers of values, and marks on fields."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

if TYPE_CHECKING:  # describing what a file may contain needs no YAML
    from hilrig.experiment.document import Keys


class SchemaFinding(NamedTuple):
    """One problem in the data, at `path`; `on_key` if the key there is wrong, not its value."""

    path: Keys
    message: str
    on_key: bool = False


class InvalidError(Exception):
    """Invalid data; all problems are in `findings`."""

    def __init__(self, findings: list[SchemaFinding]) -> None:
        self.findings = findings
        super().__init__("; ".join(finding.message for finding in findings))

    def below(self, key: str | int) -> list[SchemaFinding]:
        """Return the findings with paths from the parent, which has the data under `key`."""
        return [finding._replace(path=(key, *finding.path)) for finding in self.findings]


def invalid(message: str, *path: str | int) -> InvalidError:
    """Return an error with one finding."""
    return InvalidError([SchemaFinding(path, message)])


class Context(NamedTuple):
    """The context in which values are read."""

    base: Path
    """Folder that relative paths start from"""
    unit: str = ""
    """What the unit "m|N" stands for: "m" for a position, "N" for a force"""


class Reader(NamedTuple):
    """How one field is read."""

    read: Callable[[Any, Context], Any]
    """Returns the field's value for a value from the file. Raises InvalidError"""
    schema: Callable[[], dict[str, Any]]
    """Returns the JSON Schema of the accepted values; called only on demand, because it loads every kind"""


@dataclass(frozen=True)
class ByAxis:
    """Marks a mapping from axis to kind, or one kind if there is only one axis; `unit` is what "m|N" stands for."""

    unit: Literal["m", "N"]


ONLY_AXIS = ""
"""The axis of a kind given without an axis"""

Later = float | str | None
"""A quantity whose unit depends on other fields: passed on as written, and converted where the unit is known"""
