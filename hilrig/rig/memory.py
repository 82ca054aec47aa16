"""The memory of a process: what its loop needs is there and locked before the loop starts, and a law's has an end."""

from __future__ import annotations

import ctypes
import mmap
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hilrig.core.errors import RigError, describe_error

MCL_CURRENT, MCL_FUTURE = 1, 2
MLOCK_ONFAULT = 1
MAP_NORESERVE = 0x4000
M_TRIM_THRESHOLD, M_MMAP_MAX = -1, -4
NEVER = 2**31 - 1
HEAP = 32 << 20
"""Bytes of heap allocated beforehand; the loop allocates and frees a few kilobytes per tick"""
_libc = ctypes.CDLL(None, use_errno=True)
_libc.malloc.restype = ctypes.c_void_p
_libc.malloc.argtypes = [ctypes.c_size_t]
_libc.free.argtypes = [ctypes.c_void_p]
_libc.mlock2.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]


def lock() -> tuple[str, str]:
    """Lock all memory of this process, present and future; return (what was done, why not everything).

    The heap is allocated beforehand and never given back, which needs no privilege. Locking is tried only if no limit
    applies: under a limit, MCL_FUTURE makes a later malloc fail, and MCL_CURRENT stops the stack and the heap from
    growing. The stack needs no preparation: imports and compilation went deeper than the loop will, and it never
    shrinks.
    """
    _make_heap()
    if limit_binds():
        limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
        return "heap made, not locked", f"the limit of locked memory (ulimit -l) is {limit >> 10} KiB"
    if _libc.mlockall(MCL_CURRENT | MCL_FUTURE) != 0:
        return "heap made, not locked", os.strerror(ctypes.get_errno())
    return "locked", ""


def limit_binds() -> bool:
    """Return whether RLIMIT_MEMLOCK applies to this process, by trying to lock one page more than it allows.

    Capabilities do not show this: root in a user namespace has CAP_IPC_LOCK, and the limit still applies. With
    MLOCK_ONFAULT no page is touched.
    """
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if limit == resource.RLIM_INFINITY:
        return False
    size = limit + mmap.PAGESIZE
    try:
        area = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | MAP_NORESERVE)
    except (OSError, OverflowError):
        return True
    with area:
        start = ctypes.c_char.from_buffer(area)
        binds = _libc.mlock2(ctypes.addressof(start), size, MLOCK_ONFAULT) != 0
        del start  # the map cannot be closed while a pointer into it exists
    return binds


class LawMemory:
    """What a law may take: `allowed` bytes more than this process has now; None for no limit.

    Without a limit the kernel would end some process of the machine, not always the one that asked.
    """

    def __init__(self, allowed: float | None) -> None:
        self._allowed = allowed
        soft, self._hard = self._before = resource.getrlimit(resource.RLIMIT_DATA)
        least = soft if soft != resource.RLIM_INFINITY else None
        wanted = None if allowed is None else data_size() + round(allowed)
        self._limit = min((each for each in (least, wanted) if each is not None), default=resource.RLIM_INFINITY)

    @contextmanager
    def bounded(self) -> Iterator[None]:
        """Limit the memory of this process while the body, with the law in it, runs.

        Raises RigError if it asks for more. The limit is lifted first: to report an error takes memory too.
        """
        resource.setrlimit(resource.RLIMIT_DATA, (self._limit, self._hard))
        try:
            yield
        except MemoryError as error:
            resource.setrlimit(resource.RLIMIT_DATA, self._before)
            allowed = "" if self._allowed is None else f"a law may take {self._allowed / 1e9:g} GB (rig.law_memory): "
            raise RigError(f"out of memory: {allowed}{describe_error(error)}") from error
        finally:
            resource.setrlimit(resource.RLIMIT_DATA, self._before)


def data_size() -> int:
    """Return how much of what RLIMIT_DATA limits this process has, bytes: heap, stacks and private maps."""
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmData:"))
    return int(line.split()[1]) << 10


def _make_heap() -> None:
    """Grow the heap and make malloc keep it: it maps no blocks separately and returns nothing to the system."""
    _libc.mallopt(M_MMAP_MAX, 0)
    _libc.mallopt(M_TRIM_THRESHOLD, NEVER)
    block = _libc.malloc(HEAP)
    if block:
        ctypes.memset(block, 0, HEAP)
        _libc.free(block)
