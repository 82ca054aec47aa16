"""Compiled functions: `@kernel` marks mathematics that numba compiles and keeps on disk.

Every trial runs in fresh processes, so a kernel is compiled once on a machine and then loaded. To see whether what it
kept is still good, numba looks only at the file that a function stands in; a kernel that calls one of another file
would be stale once that file has changed. So what is kept goes into a folder named after the state of all sources that
a kernel can depend on, and a changed source starts a new folder.

With NUMBA_DISABLE_JIT=1 every kernel stays the Python function that it was written as, so that a debugger can step
through it. Trials then give the same results, much more slowly.
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

# Without its runtime for reference counts ("_nrt") numba refuses to make an array. Inlining, because the calls would
# take longer than the work that is done in them.
_WITHOUT_ARRAYS = {"_nrt": False, "forceinline": True}
# A kernel can depend only on those files of hilrig's that have one of these in them. NamedTuple: a kernel is compiled
# for the types of its arguments, and most of those are such tuples.
_MARKS = (b"@kernel", b"@jitable", b"NamedTuple")
# Settings of numba's that change the machine code, but not the key under which numba keeps it.
_CODE_SETTINGS = ("OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "LOOP_VECTORIZE", "SLP_VECTORIZE")


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


@cache
def _numba() -> Any:
    """Return numba, which takes half a second to load. Raises HilrigError if it cannot read its settings."""
    try:
        import numba
        import numba.extending
    except ImportError:
        raise
    except Exception as error:  # from reading its settings: YAML's errors and others, each with a class of its own
        raise HilrigError(
            f"numba cannot read its settings: {error}; look at {os.path.abspath('.numba_config.yaml')} and at the "
            "variables that begin with NUMBA_"
        ) from error
    return numba


def _register() -> None:
    while _unregistered:
        _numba().extending.register_jitable(_unregistered.pop())


def kernel(function: Function) -> Function:
    """Compile `function` with numba, strictly IEEE (no fast-math), kept on disk.

    It is compiled when it is first called, and the Python function stays reachable as `.py_func`. Raises HilrigError if
    the folder for what is kept cannot be written.
    """
    return _plain(function) if _interpreted else _compiled(function, _cache_folder(function))


def kernel_without_arrays(function: Function) -> Function:
    """Compile `function` as `kernel` does; it makes no array, but works only on those it is given.

    numba counts the references to every array that a kernel touches, which takes most of the time of a kernel that only
    passes arrays on. This one does without, and becomes part of the kernel that calls it.
    """
    return _plain(function) if _interpreted else _compiled(function, _cache_folder(function), **_WITHOUT_ARRAYS)


def _plain(function: Function) -> Function:
    """Return the function as it is; `can_be_composed` and `composed` look for this attribute."""
    cast(Any, function).py_func = function
    return function


def can_be_composed(function: Callable[..., Any]) -> bool:
    """Return whether `function` was made by `kernel` from a function without a closure.

    The values in a closure are not in the source: two compositions that differ only in them would share a folder.
    """
    return hasattr(function, "py_func") and not cast(Any, function).py_func.__closure__


def assembled(template: Function, makes_arrays: bool = True, **parts: Callable[..., Any]) -> Function:
    """Return `template` with these parts: compiled if all of them are kernels, in plain Python if one is not."""
    if all(map(can_be_composed, parts.values())):
        return composed(template, makes_arrays, **parts)
    return filled(template, **parts)


def composed(template: Function, makes_arrays: bool = True, **parts: Callable[..., Any]) -> Function:
    """Return `template` as a kernel in which the global names given by `parts` stand for these kernels.

    Say `makes_arrays=False` of a template that makes none; see `kernel_without_arrays`. One that does releases the GIL
    while it runs. The same template and parts give the same kernel again, so that it is loaded only once a process.
    """
    # numba takes kernels as arguments, too, but does not keep what it compiles then. Globals are constants to it: a
    # copy of the template with other globals is a kernel like any other, and is kept.
    return cast(Function, _composed(template, makes_arrays, tuple(sorted(parts.items()))))


def filled(template: Function, **parts: Callable[..., Any]) -> Function:
    """Return `template` in plain Python, with the global names given by `parts` standing for these functions."""
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
    # Only what Python calls can release the GIL; a template without arrays is a part of another.
    options = {"nogil": True} if makes_arrays else _WITHOUT_ARRAYS
    # numba names what it keeps after the template alone: compositions of one template need folders of their own.
    return _compiled(bound, os.path.join(_cache_folder(template), bound.composition), **options)


def _digest_of(parts: dict[str, Any]) -> str:
    """Return a digest of the parts: which name each has, its sources and, if it is composed itself, its own parts."""
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

    These are hilrig's files with kernels and with the types they pass. Of a folder outside hilrig they are all files: a
    kernel may take a number from one in which nothing marks it.
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
    """Return where to keep what is compiled from `function`: below $HILRIG_CACHE_DIR, else the user's cache folder."""
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
    # numba chooses the folder while it decorates, from settings that hold for the whole process: put them back at once.
    # A locator that the user set would come before our folder.
    ours = {"CACHE_DIR": folder, "CACHE_LOCATOR_CLASSES": ""}
    before = {name: getattr(config, name, "") for name in ours}
    _set(config, ours)
    try:
        kept = _can_be_kept(function)
        # error_model "numpy": a division by zero gives inf or nan, as NumPy's does, instead of an exception.
        return cast(Function, numba.njit(cache=kept, error_model="numpy", **options)(function))
    finally:
        _set(config, before)


def _set(config: Any, settings: dict[str, str]) -> None:
    for name, value in settings.items():
        setattr(config, name, value)


def _can_be_kept(function: Callable[..., Any]) -> bool:
    """Return whether numba can keep what it compiles: it cannot name files after a path that is not UTF-8."""
    try:
        function.__code__.co_filename.encode()
    except UnicodeEncodeError:
        return False
    return True


@cache
def _make_writable(folder: str) -> None:
    """Make the folder, or raise HilrigError: numba would quietly use one beside the source, which may be stale."""
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
