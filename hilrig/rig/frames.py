"""How messages are framed on the bus, and how a receiver judges them before anything reads them.

Every message begins with its lead: the epoch of the trial, drawn anew for each, and a tag for channel and sender. So a
message of another trial, another rig or another program is never taken for one of this trial. State and command follow
with their tick, which must be one that can come now; all others with their number, which must be the next one.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections import Counter
from collections.abc import Iterable

from hilrig.recording.messages.codec import CDR_HEADER

EPOCH_BYTES = 8
LEAD_BYTES = EPOCH_BYTES + 4
_FORMAT = 1
"""Version of the messages, part of the tag"""
_NUMBER = struct.Struct("<Q")
_HEAD = struct.Struct(f"<{LEAD_BYTES + len(CDR_HEADER)}sQ")
"""Head and tick of a state or command"""
NO_EPOCH = bytes(EPOCH_BYTES)
"""For a bus that no trial runs on"""

MALFORMED, FOREIGN, OLD, FUTURE = "malformed", "foreign", "old", "future"
"""Why a message is refused: its size or form; its epoch or sender; a tick or number that was there, or cannot be yet"""


def new_epoch() -> bytes:
    """Return a random epoch."""
    return os.urandom(EPOCH_BYTES)


def lead(epoch: bytes, channel: str, sender: str) -> bytes:
    """Return the first bytes of every message on a channel from a sender, in the trial with this epoch."""
    return epoch + zlib.crc32(f"hilrig {_FORMAT} {channel} {sender}".encode()).to_bytes(4, "little")


def tick_of(message: bytes) -> int:
    """Return the tick of a framed state or command."""
    return _HEAD.unpack_from(message)[1]


class TickScreen:
    """Judges the messages of a channel with one message per tick: the states or the commands of a trial."""

    def __init__(self, lead: bytes, size: int) -> None:
        """`size` is that of the messages, without the lead."""
        self._head, self._size, self.end = lead + CDR_HEADER, LEAD_BYTES + size, lead
        self.last = -1
        """Tick of the last message that was let through"""
        self.newest = -1
        """Newest tick that can come, set by the receiver"""
        self.refused: Counter[str] = Counter()
        """Number of messages refused, by reason"""

    def passes(self, message: bytes) -> bool:
        """Return whether the message is the next one of this channel; count it if not."""
        if len(message) == self._size:
            head, tick = _HEAD.unpack_from(message)
            if head == self._head:
                if self.last < tick <= self.newest:
                    self.last = tick
                    return True
                self.refused[OLD if tick <= self.last else FUTURE] += 1
                return False
        if message != self.end:
            self.refused[MALFORMED if message.startswith(self.end) else FOREIGN] += 1
        return False


class NumberScreen:
    """Judges the messages of a channel on which every sender numbers its messages."""

    def __init__(self, leads: Iterable[bytes], complete: bool) -> None:
        """`complete`: no message may be missing; otherwise numbers only have to grow."""
        self._last = dict.fromkeys(leads, 0)
        self._complete = complete
        self.refused: Counter[str] = Counter()

    def body(self, message: bytes) -> bytes | None:
        """Return the message without its frame; None if it is refused."""
        head = message[:LEAD_BYTES]
        if head not in self._last:
            self.refused[FOREIGN] += 1
            return None
        if len(message) < LEAD_BYTES + _NUMBER.size:
            self.refused[MALFORMED] += 1
            return None
        (number,) = _NUMBER.unpack_from(message, LEAD_BYTES)
        last = self._last[head]
        if number <= last or (self._complete and number > last + 1):
            self.refused[OLD if number <= last else FUTURE] += 1
            return None
        self._last[head] = number
        return message[LEAD_BYTES + _NUMBER.size :]


def numbered(lead: bytes, number: int, body: bytes) -> bytes:
    """Return a message framed by its lead and its number, which begins with 1."""
    return lead + _NUMBER.pack(number) + body
