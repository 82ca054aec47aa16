"""A digest of the recording of a run, so that two versions of hilrig can be compared bit by bit.

Bags are read with mcap only, so a fault in hilrig's own reader cannot hide a difference.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Mapping
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader

TOPICS = ("/command", "/internals", "/state", "/truth")
"""Without the timing channels: time stamps differ from run to run"""
LENGTH = 16
"""Hex digits of a digest"""


class UnreadableBagError(Exception):
    """A bag that cannot be read to its end."""


def digests(run: Path) -> dict[str, dict[str, str]]:
    """Return trial -> topic -> digest for each bag of a run directory. Topics without messages are left out."""
    return {bag.parent.name: digest_of(bag) for bag in sorted(run.glob("trials/*/bag.mcap"))}


def digest_of(bag: Path) -> dict[str, str]:
    """Return topic -> SHA-256 of the bytes of its messages in the order of the file, the first `LENGTH` hex digits."""
    found: dict[str, hashlib._Hash] = {}
    try:
        with bag.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages(topics=TOPICS, log_time_order=False):
                found.setdefault(channel.topic, hashlib.sha256()).update(message.data)
    except (McapError, struct.error, ValueError) as error:
        raise UnreadableBagError(f"{bag}: not a whole bag ({type(error).__name__})") from error
    return {topic: found[topic].hexdigest()[:LENGTH] for topic in sorted(found)}


def line(trial: str, topics: Mapping[str, str]) -> str:
    """Return one trial's digests as a line: TRIAL /command=... /internals=... /state=... /truth=..."""
    return " ".join([trial, *(f"{topic}={digest}" for topic, digest in topics.items())])
