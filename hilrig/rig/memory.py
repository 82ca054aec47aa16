"""Memory that no page fault holds up: locked, and the heap made before the loop starts."""

from __future__ import annotations

import ctypes
import mmap
import os
import resource

MCL_CURRENT, MCL_FUTURE = 1, 2
MLOCK_ONFAULT = 1
MAP_NORESERVE = 0x4000
M_TRIM_THRESHOLD, M_MMAP_MAX = -1, -4
NEVER = 2**31 - 1
HEAP = 32 << 20
"""bytes of heap that are made beforehand; the loop allocates some kilobytes a tick, and frees them"""
_libc = ctypes.CDLL(None, use_errno=True)
_libc.malloc.restype = ctypes.c_void_p
_libc.malloc.argtypes = [ctypes.c_size_t]
_libc.free.argtypes = [ctypes.c_void_p]
_libc.mlock2.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]


def lock() -> tuple[str, str]:
    """Keep all memory of this process, present and future, where it is; return (what was done, why not all).

    The heap is made beforehand and never given back; that needs no privilege. Locking is tried only where no limit
    binds: under one, MCL_FUTURE lets a later malloc fail, and MCL_CURRENT the growth of what is there (stack, heap).
    The stack needs nothing: imports and compilation have been deeper in it than the loop will be, and it never shrinks.
    """
    _make_heap()
    if limit_binds():
        limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
        return "heap made, not locked", f"the limit of locked memory (ulimit -l) is {limit >> 10} KiB"
    if _libc.mlockall(MCL_CURRENT | MCL_FUTURE) != 0:
        return "heap made, not locked", os.strerror(ctypes.get_errno())
    return "locked", ""


def limit_binds() -> bool:
    """Return whether RLIMIT_MEMLOCK holds for this process, by trying to lock one page more than it allows.

    Capabilities alone do not tell: root in a user namespace has CAP_IPC_LOCK, and is held to the limit. No page is
    touched: MLOCK_ONFAULT.
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
        del start  # the map cannot be closed while something points into it
    return binds


def _make_heap() -> None:
    """Let the heap have room that it keeps: no block is mapped on its own, and nothing is given back."""
    _libc.mallopt(M_MMAP_MAX, 0)
    _libc.mallopt(M_TRIM_THRESHOLD, NEVER)
    block = _libc.malloc(HEAP)
    if block:
        ctypes.memset(block, 0, HEAP)
        _libc.free(block)
