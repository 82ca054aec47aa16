"""The zenoh bus. The only file that imports zenoh.

Discovery is off and every endpoint is explicit. A participant declares its subscriptions first and its liveliness token
last, and declarations keep their order on a link. So a participant whose token is visible can receive messages.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Any

import zenoh

from hilrig.core.errors import RigError

DEPTH = 4096
"""Messages that an inbox holds; one more blocks its sender (lockstep) or is lost (real time)"""

TOKENS_TIMEOUT_S = 1.0
"""How long to wait for the others' liveliness tokens"""
LOOK_S = 0.005
"""Time between two checks of the tokens"""


def configuration(listen: Iterable[str], connect: Iterable[str], low_latency: bool = True) -> zenoh.Config:
    """Return the configuration of a participant that listens and connects at these endpoints."""
    config = zenoh.Config()
    settings = {
        "mode": "peer",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        # Opening does not wait for the others: tokens show who is missing, and the connection is retried.
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 20, "period_max_ms": 100, "period_increase_factor": 1},
        # The low-latency link has no priorities; zenoh refuses to open with both.
        "transport/unicast/lowlatency": low_latency,
        "transport/unicast/qos/enabled": not low_latency,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


class Inbox:
    """Receives the messages of one key, in order of arrival."""

    def __init__(self, subscriber: Any) -> None:
        self._subscriber = subscriber

    def take(self) -> bytes:
        """Wait for the next message and return it. Ends when the bus is closed, or by a signal that raises."""
        return self._subscriber.recv().payload.to_bytes()

    def poll(self) -> bytes | None:
        """Return the next message, None if there is none yet."""
        sample = self._subscriber.try_recv()
        return None if sample is None else sample.payload.to_bytes()


class Outbox:
    """Sends on one key."""

    def __init__(self, publisher: Any) -> None:
        self.put: Callable[[bytes], None] = publisher.put
        """Send one message"""

    def end(self) -> None:
        """Send an empty message, which marks the end of the channel."""
        self.put(b"")


class Bus:
    """One participant on the bus of one trial."""

    def __init__(
        self, trial: str, role: str, listen: Iterable[str], connect: Iterable[str], low_latency: bool = True
    ) -> None:
        self._root, self._role = f"hilrig/{trial}", role
        try:
            self._session = zenoh.open(configuration(listen, connect, low_latency))
        except zenoh.ZError as error:
            raise RigError(f"{role}: cannot join the bus ({error})") from error
        self._token: Any = None

    def outbox(self, channel: str, *, blocking: bool) -> Outbox:
        """Return a sender. A blocking one waits for slow receivers; the other drops what they do not take in time."""
        control = zenoh.CongestionControl.BLOCK if blocking else zenoh.CongestionControl.DROP
        key = f"{self._root}/{channel}"
        return Outbox(self._session.declare_publisher(key, express=True, congestion_control=control))

    def inbox(self, channel: str, *, latest_only: bool = False) -> Inbox:
        """Return a receiver of every message in order, or of the latest one only."""
        handler = zenoh.handlers.RingChannel(1) if latest_only else zenoh.handlers.FifoChannel(DEPTH)
        return Inbox(self._session.declare_subscriber(f"{self._root}/{channel}", handler))

    def announce(self) -> None:
        """Declare that this participant is alive and has made all its subscriptions."""
        self._token = self._session.liveliness().declare_token(f"{self._root}/alive/{self._role}")

    def alive(self) -> set[str]:
        """Return the roles whose tokens are visible from here."""
        replies = self._session.liveliness().get(f"{self._root}/alive/*", timeout=TOKENS_TIMEOUT_S)
        return {str(reply.ok.key_expr).rsplit("/", 1)[1] for reply in replies if reply.ok is not None}

    def wait_for(self, roles: Iterable[str], timeout_s: float) -> set[str]:
        """Wait until the tokens of all `roles` are visible, `timeout_s` at most; return the roles that are missing."""
        missing, deadline = set(roles), time.monotonic() + timeout_s
        while missing := missing - self.alive():
            if time.monotonic() > deadline:
                return missing
            time.sleep(LOOK_S)
        return missing

    def close(self) -> None:
        """Leave the bus."""
        if not self._session.is_closed():
            self._session.close()

    def __enter__(self) -> Bus:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
