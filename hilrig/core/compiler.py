"""Compiled functions: `@kernel` marks mathematics that numba compiles and keeps between processes.

Every trial runs in fresh processes, so a kernel is compiled once for a machine and then loaded. numba itself looks only
at the file in which a function stands; a kernel that calls another file's kernel would go stale when that file changes.
So the cache's folder is named after the state of all sources that a kernel can call: a changed source starts a new one.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from functools import cache, lru_cache
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

from hilrig.core.errors import HilrigError

Function = TypeVar("Function", bound=Callable[..., Any])


_BARE = {"_nrt": False, "forceinline": True}
"""What numba is told of a kernel that makes no arrays"""
_MARKS = (b"@kernel", b"@jitable", b"NamedTuple")
"""What stands in a file that kernels depend on"""


_unregistered: list[Callable[..., Any]] = []
"""Functions marked `jitable` that numba has not been told of yet"""
_interpreted = False


def interpret() -> None:
    """Leave the kernels that are marked from now on plain Python, unless numba is loaded already.

    For a process that looks at experiments and runs none: numba takes longer to load, and its first kernel to be
    compiled, than all that such a process has to do.
    """
    global _interpreted
    _interpreted = "numba" not in sys.modules


def jitable(function: Function) -> Function:
    """Mark a function that kernels can call and that stays plain Python elsewhere: for what costs less than a call."""
    _unregistered.append(function)
    # With the first kernel otherwise: signals are marked so, and most processes that have signals have no kernels.
    if "numba" in sys.modules:
        _register()
    return function


def _register() -> None:
    from numba.extending import register_jitable

    while _unregistered:
        register_jitable(_unregistered.pop())


@cache
def _source_state(folder: Path) -> str:
    """Digest of the sources that a kernel in `folder` can depend on.

    These are hilrig's own files with kernels and the types they pass, and every file of a folder outside hilrig: what
    of it a kernel takes, a number for instance, cannot be seen from its text.
    """
    import numba

    digest = hashlib.sha256(numba.__version__.encode())
    package = Path(__file__).parents[1]
    own = [(path, path.read_bytes()) for path in sorted(package.rglob("*.py"))]
    sources = [(path, text) for path, text in own if any(mark in text for mark in _MARKS)]
    if not folder.is_relative_to(package):
        sources += [(path, path.read_bytes()) for path in sorted(folder.glob("*.py"))]
    for path, text in sources:
        digest.update(f"{path.name}:{len(text)};".encode() + text)
    return digest.hexdigest()[:16]


def _cache_folder(function: Callable[..., Any]) -> str:
    """Where what is compiled from `function` is kept: below $HILRIG_CACHE_DIR, else the user's cache directory."""
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    base = os.environ.get("HILRIG_CACHE_DIR") or os.path.join(user, "hilrig")
    return os.path.join(base, "kernels", _state_of(function))


def _state_of(function: Callable[..., Any]) -> str:
    return _source_state(Path(function.__code__.co_filename).parent)


def kernel(function: Function) -> Function:
    """Compile `function` with numba, strictly IEEE (no fast-math), cached between processes.

    The plain Python function stays reachable as `.py_func`. Raises HilrigError if the cache cannot be written.
    """
    return _plain(function) if _interpreted else _compiled(function, _cache_folder(function))


def kernel_without_arrays(function: Function) -> Function:
    """Compile `function` as `kernel` does; it makes no array, it only works on those it is given.

    numba counts the references to every array that a kernel touches, which takes most of the time of one that only
    passes arrays on. This one goes without, and becomes part of the kernel that calls it.
    """
    return _plain(function) if _interpreted else _compiled(function, _cache_folder(function), **_BARE)


def _plain(function: Function) -> Function:
    cast(Any, function).py_func = function
    return function


def can_be_composed(function: Callable[..., Any]) -> bool:
    """Return whether `function` was made by `kernel`, of a function without a closure.

    What a closure holds is not in the source: a composition with other values in it would be taken for the same.
    """
    return hasattr(function, "py_func") and not cast(Any, function).py_func.__closure__


def composed(template: Function, makes_arrays: bool = True, **parts: Callable[..., Any]) -> Function:
    """Return `template` as a kernel in which the global names given by `parts` stand for these kernels.

    numba can take functions as arguments, but then keeps nothing between processes. A copy of the template whose
    globals name the parts is compiled like any other kernel, and kept in a folder of this composition.

    Say `makes_arrays=False` of a template that makes none; see `kernel_without_arrays`. Other threads go on while one
    that does is at work. Asked again for the same, it gives the same kernel, which need not be loaded again.
    """
    return cast(Function, _composed(template, makes_arrays, tuple(sorted(parts.items()))))


@lru_cache(maxsize=64)
def _composed(
    template: Callable[..., Any], makes_arrays: bool, parts: tuple[tuple[str, Callable[..., Any]], ...]
) -> Callable[..., Any]:
    bound: Any = filled(template, **dict(parts))
    if _interpreted:
        return _plain(bound)
    bound.composition = _digest_of({name: cast(Any, part).py_func for name, part in parts})
    options = {"nogil": True} if makes_arrays else _BARE
    return _compiled(bound, os.path.join(_cache_folder(template), bound.composition), **options)


def _digest_of(parts: dict[str, Any]) -> str:
    """Digest of what a template is composed of: where each part stands, its sources and, if composed, its own parts."""
    words = [
        f"{name}={part.__module__}.{part.__qualname__} {_state_of(part)} {getattr(part, 'composition', '')}"
        for name, part in parts.items()
    ]
    return hashlib.sha256("; ".join(words).encode()).hexdigest()[:16]


def filled(template: Function, **parts: Callable[..., Any]) -> Function:
    """Return `template` in plain Python, with the global names given by `parts` standing for these functions."""
    bound = FunctionType(template.__code__, {**template.__globals__, **parts}, template.__name__)
    bound.__module__, bound.__qualname__ = template.__module__, template.__qualname__
    return cast(Any, bound)


def _compiled(function: Function, folder: str, **options: Any) -> Function:
    import numba
    from numba.core import config

    _register()
    before = config.CACHE_DIR  # pyright: ignore[reportAttributeAccessIssue]
    _make_writable(folder)
    config.CACHE_DIR = folder  # pyright: ignore[reportAttributeAccessIssue]
    try:
        return cast(Function, numba.njit(cache=True, error_model="numpy", **options)(function))
    finally:
        config.CACHE_DIR = before  # pyright: ignore[reportAttributeAccessIssue]


@cache
def _make_writable(folder: str) -> None:
    """Make the folder. Without one numba would fall back to a cache beside the source, which can be stale."""
    try:
        os.makedirs(folder, exist_ok=True)
        writable = os.access(folder, os.W_OK)
        reason = "" if writable else "it cannot be written"
    except OSError as error:
        reason = str(error.strerror)
    if reason:
        raise HilrigError(
            f"{folder}: compiled control laws are kept here, and {reason}; "
            "set HILRIG_CACHE_DIR to a folder that can be written"
        )
