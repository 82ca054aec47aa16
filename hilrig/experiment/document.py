"""A YAML 1.2 file as plain data, with the place in the file of every key and value."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from hilrig.core.errors import ExperimentError, Place, Problem, nearest
from hilrig.core.quantities import shown
from hilrig.core.text import NotUtf8Error, decoded

MAX_YAML_BYTES = 1 << 20
MAX_NODES = 100_000
"""A few lines with aliases can expand to more values than fit into memory."""

Keys = tuple[str | int, ...]
"""Where something is in the data: keys of mappings and indices of lists"""

_CORE = "tag:yaml.org,2002:"
_CONSTANTS: dict[str, dict[str, Any]] = {
    "null": dict.fromkeys(("", "~", "null")),
    "bool": {**dict.fromkeys(("true", "yes", "on", "y"), True), **dict.fromkeys(("false", "no", "off", "n"), False)},
}
"""The meaning of these words in YAML; booleans other than true and false only after %YAML 1.1"""
_HALF = re.compile("[\ud800-\udfff]")
_SCALARS = ("null", "bool", "int", "float", "str", "timestamp", "merge")


@dataclass(frozen=True)
class Document:
    """Plain data and where it was written."""

    file: str
    data: Any
    values: dict[Keys, Place] = field(default_factory=dict)
    """Place of each value"""
    keys: dict[Keys, Place] = field(default_factory=dict)
    """Place of each key of a mapping"""
    written: dict[Keys, str] = field(default_factory=dict)
    """Each scalar as it is written in the file"""

    def place(self, *path: str | int, key: bool = False) -> Place:
        """Return the place of the value at `path`, or of its key; if there is none, the place of what encloses it."""
        if key and path in self.keys:
            return self.keys[path]
        while path and path not in self.values:
            path = path[:-1]
        return self.values.get(path, Place(self.file, 1, 1))


def read_document(path: Path) -> Document:
    """Read a file whose content is one mapping. Raises ExperimentError with every problem's place."""
    start = Place(str(path), 1, 1)
    try:
        with path.open("rb") as file:
            content = file.read(MAX_YAML_BYTES + 1)
    except FileNotFoundError as error:
        raise ExperimentError(
            [Problem(None, f"{path}: there is no such file{nearest(path.name, _siblings(path))}")]
        ) from error
    except IsADirectoryError as error:
        raise ExperimentError([Problem(None, f"{path}: is a directory, not a file")]) from error
    except OSError as error:
        raise ExperimentError([Problem(None, f"{path}: cannot be read: {error.strerror}")]) from error
    if len(content) > MAX_YAML_BYTES:
        raise ExperimentError(
            [Problem(start, f"is larger than {MAX_YAML_BYTES >> 20} MiB, too large for an experiment")]
        )
    try:
        text = decoded(content)
    except NotUtf8Error as error:
        raise ExperimentError([Problem(Place(str(path), error.line, error.column), str(error))]) from error
    document = parse(text, str(path))
    if not isinstance(document.data, dict):
        found = "a list" if isinstance(document.data, list) else "empty" if document.data is None else "a single value"
        raise ExperimentError([Problem(start, f"an experiment is a mapping of keys to values; this file is {found}")])
    return document


def _siblings(path: Path) -> list[str]:
    return [item.name for item in path.parent.glob("*.y*ml")]


def parse(text: str, file: str) -> Document:
    """Return the data of one YAML document. Raises ExperimentError with every problem's place in `file`."""
    try:
        node = YAML(typ="safe", pure=True).compose(io.StringIO(text))
        reader = _Reader(file)
        data = reader.value(node, ()) if node is not None else None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Place(file, mark.line + 1, mark.column + 1) if mark else Place(file, 1, 1)
        raise ExperimentError([Problem(place, _syntax_message(error))]) from error
    except YAMLError as error:
        raise ExperimentError([Problem(_control_place(text, file), f"is not YAML: {_one_line(error)}")]) from error
    except RecursionError as error:
        raise ExperimentError([Problem(Place(file, 1, 1), "is nested too deeply")]) from error
    if reader.problems:
        raise ExperimentError(reader.problems)
    return Document(file, data, reader.values, reader.keys, reader.written)


class _Reader:
    """Turns YAML nodes into data, and notes where each was written."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._count = 0
        self._open: list[int] = []
        self.values: dict[Keys, Place] = {}
        self.keys: dict[Keys, Place] = {}
        self.written: dict[Keys, str] = {}
        self.problems: list[Problem] = []

    def value(self, node: Node, path: Keys) -> Any:
        """Return the data of `node`, which is at `path`."""
        self._count += 1
        if self._count > MAX_NODES:
            raise ExperimentError(
                [Problem(self._place(node), f"the aliases in this file expand to more than {MAX_NODES} values")]
            )
        # An alias is the same node as its anchor, so its place is that of the anchor's value.
        self.values[path] = self._place(node)
        if id(node) in self._open:
            self._problem(node, "this anchor contains itself")
            return None
        self._open.append(id(node))
        data = self._content(node, path)
        self._open.pop()
        return data

    def _content(self, node: Node, path: Keys) -> Any:
        tag = str(node.tag)
        if isinstance(node, MappingNode) and tag == _CORE + "map":
            return {key: self.value(item, (*path, key)) for key, item in self._items(node, path)}
        if isinstance(node, SequenceNode) and tag == _CORE + "seq":
            return [self.value(item, (*path, i)) for i, item in enumerate(node.value)]
        if isinstance(node, ScalarNode) and tag.removeprefix(_CORE) in _SCALARS:
            self.written[path] = node.value
            return self._scalar(node, tag.removeprefix(_CORE))
        self._problem(node, f"the tag {tag.replace(_CORE, '!!')} is not allowed; an experiment is plain data")
        return None

    def _items(self, node: MappingNode, path: Keys) -> Iterator[tuple[str, Node]]:
        seen: dict[str, Node] = {}
        for key, item in node.value:
            if not isinstance(key, ScalarNode) or not key.value or _HALF.search(key.value):
                self._problem(key, "a key must be a name")
            elif str(key.tag) == _CORE + "merge":
                self._problem(key, "merge keys (<<) are not part of YAML 1.2; write the values out, or use an alias")
            elif key.value in seen:
                first = seen[key.value].start_mark.line + 1
                self._problem(key, f"the key '{key.value}' appears twice; first on line {first}")
            else:
                seen[key.value] = key
                self.keys[(*path, key.value)] = self._place(key)
                yield key.value, item

    def _scalar(self, node: ScalarNode, kind: str) -> Any:
        text = node.value
        try:
            if kind == "null":
                return _CONSTANTS["null"][text.lower()]
            if kind == "bool":
                return _CONSTANTS["bool"][text.lower()]
            if kind == "int":
                return int(text.replace("_", ""), 0 if text.lstrip("+-")[:2] in ("0x", "0o") else 10)
            if kind == "float":
                return float(text.replace("_", "").lower().replace(".inf", "inf").replace(".nan", "nan"))
        except KeyError:
            self._problem(node, f"{shown(text)} is not a {kind}")
        except ValueError:
            digits = text.lstrip("+-").replace("_", "")
            what = f"has {len(digits)} digits, too many to read" if digits.isdecimal() else "is not a number"
            self._problem(node, f"{shown(text)} {what}")
        if _HALF.search(text):
            self._problem(node, "this text holds one half of a surrogate pair, which is not a character")
        return text

    def _place(self, node: Node) -> Place:
        return Place(self._file, node.start_mark.line + 1, node.start_mark.column + 1)

    def _problem(self, node: Node, message: str) -> None:
        self.problems.append(Problem(self._place(node), message))


def _syntax_message(error: MarkedYAMLError) -> str:
    parts = [part for part in (error.problem, error.context) if part]
    return f"is not YAML: {_one_line(', '.join(parts))}"


def _one_line(text: object) -> str:
    return " ".join(str(text).split())


def _control_place(text: str, file: str) -> Place:
    """Return the place of the first character that YAML does not allow."""
    for line, content in enumerate(text.split("\n"), start=1):
        for column, character in enumerate(content, start=1):
            if ord(character) < 32 and character not in "\t\r":
                return Place(file, line, column)
    return Place(file, 1, 1)
