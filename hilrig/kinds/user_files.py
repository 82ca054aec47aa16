"""Kinds in users' files: running them, and reporting where something went wrong."""

from __future__ import annotations

import ast
import inspect
import sys
import types
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from hilrig.core.errors import HilrigError, PluginError, authors_line, one_line, raised

MAX_FILE_BYTES = 64 << 20


def read_bytes(path: Path) -> bytes:
    """Return a file's contents. Raises PluginError if it is not a regular file, or too large to be a user's source."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise PluginError(f"{path} is larger than {MAX_FILE_BYTES >> 20} MiB")
        if not path.is_file():  # a pipe or device may never end
            raise PluginError(f"{path} is not a regular file")
        return path.read_bytes()
    except OSError as error:
        raise PluginError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:  # a null character in the path
        raise PluginError(f"{str(path)!r} is not a path: {error}") from error


class _FromSource(SourceFileLoader):
    """Compiles the source that was read: Python's cache checks size and whole seconds only, and may be stale."""

    def __init__(self, name: str, path: str, source: bytes) -> None:
        super().__init__(name, path)
        self._source = source

    def get_code(self, fullname: str) -> types.CodeType:
        return self.source_to_code(self._source, self.path)


def run_file(path: Path, source: bytes, name: str, **names: Any) -> types.ModuleType:
    """Run the Python file with contents `source` as the module `name`, with `names` predefined, and return the module.

    Raises PluginError with the line, whatever the file raises; only Ctrl-C passes through.
    """
    if path.suffix != ".py":
        raise PluginError(f"{path} is not a Python file: its name does not end in .py")
    spec = spec_from_file_location(name, path, loader=_FromSource(name, str(path), source))
    assert spec is not None, "a loader was given"
    assert spec.loader is not None
    module = module_from_spec(spec)
    module.__dict__.update(names)
    sys.modules[name] = module  # dataclasses and numba look their module up there
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        if isinstance(error, KeyboardInterrupt):
            raise
        raise PluginError(_where_it_failed(path, error)) from error
    return module


def _where_it_failed(path: Path, error: BaseException) -> str:
    if isinstance(error, SyntaxError) and error.filename in (None, str(path)):
        return f"{path}:{error.lineno}: {error.msg}" if error.lineno else f"{path}: {error.msg}"
    place = authors_line(error)
    return f"{place[0]}:{place[1]}: {raised(error)}" if place else f"{path}: {raised(error)}"


@contextmanager
def code_of(kind: Any = None) -> Iterator[None]:
    """Turn any exception that a kind's code raises in the block into a PluginError with the author's file and line.

    `kind` is the kind or its class, if it is known whose code runs. Errors meant for the user pass unchanged, and so do
    hilrig's own faults. A kind raises ValueError for a value that does not fit: its message comes first.
    """
    cls = kind if isinstance(kind, type) or kind is None else type(kind)
    package = cls.__module__.partition(".")[0] if cls else ""
    try:
        yield
    except (HilrigError, KeyboardInterrupt):
        raise
    except BaseException as error:
        place = authors_line(error, package if package != "hilrig" else "")
        where = "{}:{}".format(*place) if place else place_of(cls) if cls and package != "hilrig" else ""
        if isinstance(error, ValueError) and (cls or place):
            text = one_line(error) or raised(error)
            raise PluginError(f"{text} ({where})" if where else text) from error
        if not where:
            raise
        raise PluginError(f"{where}: {raised(error)}") from error


def place_of(cls: type, field: str = "") -> str:
    """Return where a class, or one of its fields, is defined: "file:line", or the file alone if the line is unknown."""
    owner = next((base for base in cls.__mro__ if field in inspect.get_annotations(base)), cls)
    module = sys.modules.get(owner.__module__)
    file = str(getattr(module, "__file__", None) or owner.__module__)
    try:
        tree = ast.parse(Path(file).read_bytes())
    except (OSError, SyntaxError, ValueError):
        return file
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and node.name == owner.__name__:
            lines = {item.target.id: item.lineno for item in node.body
                     if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)}  # fmt: skip
            return f"{file}:{lines.get(field, node.lineno)}"
    return file
