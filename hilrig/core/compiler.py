"""Compiled functions: `@kernel` marks mathematics that numba compiles and caches on disk.

Every trial runs in fresh processes, so a kernel is compiled once per machine and then loaded. To decide whether a cache
entry is still valid, numba checks only the file that defines the function; a kernel that calls one from another file
would be stale after that file changes. So the cache folder is named after a digest of all sources that a kernel can
depend on, and a changed source starts a new folder.

With NUMBA_DISABLE_JIT=1 every kernel stays a Python function, so that a debugger can step through it. Trials then give
the same results, much more slowly.
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

# Without its reference-counting runtime ("_nrt") numba refuses to create an array. Inlined, because the calls would
# take longer than the work they do.
_WITHOUT_ARRAYS = {"_nrt": False, "forceinline": True}
# A kernel can depend only on hilrig files that contain one of these. NamedTuple: a kernel is compiled for the types of
# its arguments, and most of those are such tuples.
_MARKS = (b"@kernel", b"@jitable", b"NamedTuple")
# numba settings that change the machine code, but not the key under which numba caches it.
_CODE_SETTINGS = ("OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "LOOP_VECTORIZE", "SLP_VECTORIZE")


_unregistered: list[Callable[..., Any]] = []
"""Functions marked `jitable` that are not yet registered with numba"""
_interpreted = False


def interpret() -> None:
    """Leave kernels that are marked from now on as plain Python, unless numba is already loaded.

    For a process that only reads experiments: loading numba and compiling its first kernel take longer than everything
    else that such a process does.
    """
    global _interpreted
    _interpreted = "numba" not in sys.modules


def jitable(function: Function) -> Function:
    """Mark a function that kernels can call and that stays plain Python elsewhere, for work cheaper than a call."""
    _unregistered.append(function)
    # Otherwise with the first kernel: signals are marked this way, and most processes that use signals have no kernels.
    if "numba" in sys.modules:
        _register()
    return function


@cache
def _numba() -> Any:
    """Return numba, which takes half a second to load. Raises HilrigError if numba cannot read its settings."""
    try:
        import numba
        import numba.extending
    except ImportError:
        raise
    except Exception as error:  # from reading its settings: YAML errors and others, with no common base class
        raise HilrigError(
            f"numba cannot read its settings: {error}; check {os.path.abspath('.numba_config.yaml')} and the "
            "environment variables that begin with NUMBA_"
        ) from error
    return numba


def _register() -> None:
    while _unregistered:
        _numba().extending.register_jitable(_unregistered.pop())


def kernel(function: Function) -> Function:
    """Compile `function` with numba, strictly IEEE (no fast-math), cached on disk.

    It is compiled at its first call, and the Python function stays available as `.py_func`. Raises HilrigError if the
    cache folder is not writable.
    """
    return _plain(function) if _interpreted else _compiled(function, _cache_folder(function))


def kernel_without_arrays(function: Function) -> Function:
    """Compile `function` as `kernel` does; it creates no arrays and works only on those it is given.

    numba counts references to every array that a kernel touches, which takes most of the time of a kernel that only
    passes arrays on. This variant skips that, and is inlined into the kernel that calls it.
    """
    return _plain(function) if _interpreted else _compiled(function, _cache_folder(function), **_WITHOUT_ARRAYS)


def _plain(function: Function) -> Function:
    """Return the function unchanged, with the attribute that `can_be_composed` and `composed` look for."""
    cast(Any, function).py_func = function
    return function


def can_be_composed(function: Callable[..., Any]) -> bool:
    """Return whether `function` was made by `kernel` from a function without a closure.

    Closure values are not in the source: two compositions that differ only in those would share a folder.
    """
    return hasattr(function, "py_func") and not cast(Any, function).py_func.__closure__


def assembled(template: Function, makes_arrays: bool = True, **parts: Callable[..., Any]) -> Function:
    """Return `template` with these parts: compiled if all parts are kernels, otherwise in plain Python."""
    if all(map(can_be_composed, parts.values())):
        return composed(template, makes_arrays, **parts)
    return filled(template, **parts)


def composed(template: Function, makes_arrays: bool = True, **parts: Callable[..., Any]) -> Function:
    """Return `template` as a kernel in which the global names given by `parts` stand for these kernels.

    Pass `makes_arrays=False` for a template that creates no arrays; see `kernel_without_arrays`. One that does releases
    the GIL while it runs. The same template and parts return the same kernel, so it is loaded only once per process.
    """
    # numba also accepts kernels as arguments, but does not cache what it compiles then. Globals are constants to it: a
    # copy of the template with other globals is a kernel like any other, and is cached.
    return cast(Function, _composed(template, makes_arrays, tuple(sorted(parts.items()))))


def filled(template: Function, **parts: Callable[..., Any]) -> Function:
    """Return `template` in plain Python, with the global names given by `parts` bound to these functions."""
    bound = FunctionType(template.__code__, {**template.__globals__, **parts}, template.__name__)
    bound.__module__, bound.__qualname__ = template.__module__, template.__qualname__
    return cast(Any, bound)


@lru_cache(maxsize=64)
def _composed(
    template: Callable[..., Any], makes_arrays: bool, parts: tuple[tuple[str, Callable[..., Any]], ...]
) -> Callable[..., Any]:
    bound: Any = filled(template, **dict(parts))
    if _interpreted:
        return _plain(bound)
    bound.composition = _digest_of({name: cast(Any, part).py_func for name, part in parts})
    # Only what Python calls can release the GIL; a template without arrays is part of another.
    options = {"nogil": True} if makes_arrays else _WITHOUT_ARRAYS
    # numba names cache entries after the template alone, so each composition of a template needs its own folder.
    return _compiled(bound, os.path.join(_cache_folder(template), bound.composition), **options)


def _digest_of(parts: dict[str, Any]) -> str:
    """Return a digest of the parts: the name and sources of each and, if it is itself composed, its own parts."""
    words = [
        f"{name}={part.__module__}.{part.__qualname__} {_state_of(part)} {getattr(part, 'composition', '')}"
        for name, part in parts.items()
    ]
    return hashlib.sha256("; ".join(words).encode()).hexdigest()[:16]


def _state_of(function: Callable[..., Any]) -> str:
    return _source_state(Path(function.__code__.co_filename).parent)


@cache
def _source_state(folder: Path) -> str:
    """Return a digest of numba and of the sources that a kernel in `folder` can depend on.

    These are the hilrig files with kernels or the types they pass. For a folder outside hilrig they are all files: a
    kernel may take a number from a file that contains no mark.
    """
    numba = _numba()
    settings = [getattr(numba.core.config, name, None) for name in _CODE_SETTINGS]
    digest = hashlib.sha256(f"{numba.__version__} {settings}".encode())
    package = Path(__file__).parents[1]
    own = [(path, path.read_bytes()) for path in sorted(package.rglob("*.py"))]
    sources = [(path, text) for path, text in own if any(mark in text for mark in _MARKS)]
    if not folder.is_relative_to(package):
        sources += [(path, path.read_bytes()) for path in sorted(folder.glob("*.py"))]
    for path, text in sources:
        digest.update(os.fsencode(path.name) + f":{len(text)};".encode() + text)
    return digest.hexdigest()[:16]


def _cache_folder(function: Callable[..., Any]) -> str:
    """Return where to cache what is compiled from `function`: below $HILRIG_CACHE_DIR, else the user's cache folder."""
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    base = os.environ.get("HILRIG_CACHE_DIR") or os.path.join(user, "hilrig")
    return os.path.join(base, "kernels", _state_of(function))


def _compiled(function: Function, folder: str, **options: Any) -> Function:
    numba = _numba()
    config = numba.core.config
    _register()
    if config.DISABLE_JIT:
        return _plain(function)
    _make_writable(folder)
    # numba chooses the folder when it decorates, from process-wide settings: restore them at once.
    # A locator set by the user would take precedence over our folder.
    ours = {"CACHE_DIR": folder, "CACHE_LOCATOR_CLASSES": ""}
    before = {name: getattr(config, name, "") for name in ours}
    _set(config, ours)
    try:
        kept = _can_be_kept(function)
        # error_model "numpy": division by zero gives inf or nan, as in NumPy, instead of an exception.
        return cast(Function, numba.njit(cache=kept, error_model="numpy", **options)(function))
    finally:
        _set(config, before)


def _set(config: Any, settings: dict[str, str]) -> None:
    for name, value in settings.items():
        setattr(config, name, value)


def _can_be_kept(function: Callable[..., Any]) -> bool:
    """Return whether numba can cache what it compiles: it cannot name files after a path that is not UTF-8."""
    try:
        function.__code__.co_filename.encode()
    except UnicodeEncodeError:
        return False
    return True


@cache
def _make_writable(folder: str) -> None:
    """Create the folder, or raise HilrigError: numba would silently use one beside the source, which may be stale."""
    try:
        os.makedirs(folder, exist_ok=True)
        writable = os.access(folder, os.W_OK)
        reason = "" if writable else "it is not writable"
    except OSError as error:
        reason = str(error.strerror)
    if reason:
        raise HilrigError(
            f"{folder}: compiled control laws are cached here, but {reason}; set HILRIG_CACHE_DIR to a writable folder"
        )
