"""Words of the schema: what is found wrong, what values are read with and by, and marks on fields."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

if TYPE_CHECKING:  # to describe what a file may hold takes no YAML
    from hilrig.experiment.document import Keys


class SchemaFinding(NamedTuple):
    """One thing that is wrong with the data, at `path`; `on_key` if the key there is wrong, not its value."""

    path: Keys
    message: str
    on_key: bool = False


class InvalidError(Exception):
    """Data that does not fit; all that is wrong is in `findings`."""

    def __init__(self, findings: list[SchemaFinding]) -> None:
        self.findings = findings
        super().__init__("; ".join(finding.message for finding in findings))

    def below(self, key: str | int) -> list[SchemaFinding]:
        """Return the findings as they are seen from what holds the data under `key`."""
        return [finding._replace(path=(key, *finding.path)) for finding in self.findings]


def invalid(message: str, *path: str | int) -> InvalidError:
    """Return the error of one finding."""
    return InvalidError([SchemaFinding(path, message)])


class Context(NamedTuple):
    """What values are read with."""

    base: Path
    """Folder that relative paths start from"""
    unit: str = ""
    """What the unit "m|N" stands for: "m" for a position, "N" for a force"""


class Reader(NamedTuple):
    """How one field is read."""

    read: Callable[[Any, Context], Any]
    """Returns what the field gets for a value of the file. Raises InvalidError"""
    schema: Callable[[], dict[str, Any]]
    """Makes the JSON Schema of the values it takes; called when asked for, as it loads every kind there is"""


@dataclass(frozen=True)
class ByAxis:
    """Marks a mapping from axis to kind, which may be one kind if there is one axis; unit of "m|N"."""

    unit: Literal["m", "N"]


ONLY_AXIS = ""
"""The axis of a kind that was given without one"""

Later = float | str | None
"""A quantity whose unit depends on what stands beside it: passed on as written, for who knows the unit"""
