"""The zenoh bus. The only file that imports zenoh.

Discovery is off and every endpoint is explicit. A participant declares its subscriptions first and its liveliness token
last, and declarations keep their order on a link. So a participant whose token is visible can receive messages.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from threading import Lock
from types import TracebackType
from typing import Any

import zenoh

from hilrig.core.errors import RigError
from hilrig.rig.frames import MALFORMED, NO_EPOCH, NumberScreen, lead, numbered

DEPTH = 4096
"""Messages that an inbox holds; one more blocks its sender (lockstep) or is lost (real time)"""

PASSED_OVER = 256
"""Messages to be passed over that one poll looks at: the loop must not wait for a flood of them"""

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
    """Receives whatever is sent on one key, in order of arrival."""

    def __init__(self, subscriber: Any) -> None:
        self._subscriber = subscriber

    def take(self) -> bytes:
        """Wait for the next message and return it. Ends when the bus is closed, or by a signal that raises."""
        return self._subscriber.recv().payload.to_bytes()

    def poll(self) -> bytes | None:
        """Return the next message, None if there is none yet."""
        sample = self._subscriber.try_recv()
        return None if sample is None else sample.payload.to_bytes()


class NumberedInbox:
    """Receives the numbered messages of one key, without their frames. Others are counted and passed over."""

    def __init__(self, inbox: Inbox, screen: NumberScreen) -> None:
        self._inbox, self._screen = inbox, screen

    @property
    def refused(self) -> dict[str, int]:
        """Number of messages passed over, by reason"""
        return dict(self._screen.refused)

    def refuse(self) -> None:
        """Count the last message as malformed: its body cannot be read."""
        self._screen.refused[MALFORMED] += 1

    def take(self) -> bytes:
        """Wait for the next message and return it. Ends when the bus is closed, or by a signal that raises."""
        while True:
            body = self._screen.body(self._inbox.take())
            if body is not None:
                return body

    def poll(self) -> bytes | None:
        """Return the next message; None if there is none yet, or none among the next `PASSED_OVER`."""
        for _ in range(PASSED_OVER):
            message = self._inbox.poll()
            if message is None:
                return None
            body = self._screen.body(message)
            if body is not None:
                return body
        return None


class Outbox:
    """Sends messages that are framed already on one key."""

    def __init__(self, publisher: Any, lead: bytes) -> None:
        self.put: Callable[[bytes], None] = publisher.put
        """Send one message"""
        self.lead = lead
        """The first bytes of every message"""

    def end(self) -> None:
        """Send the lead alone, which marks the end of the channel."""
        self.put(self.lead)


class NumberedOutbox:
    """Frames and numbers messages, and sends them on one key. Several threads may send."""

    def __init__(self, publisher: Any, lead: bytes) -> None:
        self._publisher, self._lead = publisher, lead
        self._number, self._lock = 0, Lock()

    def put(self, message: bytes) -> None:
        """Send one message."""
        with self._lock:
            self._number += 1
            self._publisher.put(numbered(self._lead, self._number, message))


class Bus:
    """One participant on the bus of one trial, which has its own `epoch`."""

    def __init__(
        self, trial: str, role: str, listen: Iterable[str], connect: Iterable[str], low_latency: bool = True,
        epoch: bytes = NO_EPOCH,
    ) -> None:  # fmt: skip
        self._root, self._role, self._epoch = f"hilrig/{trial}", role, epoch
        self._numbered: dict[str, NumberedOutbox] = {}
        try:
            self._session = zenoh.open(configuration(listen, connect, low_latency))
        except zenoh.ZError as error:
            raise RigError(f"{role}: cannot join the bus ({error})") from error
        self._token: Any = None

    def lead(self, channel: str, sender: str) -> bytes:
        """Return the first bytes of every message on a channel from a sender."""
        return lead(self._epoch, channel, sender)

    def outbox(self, channel: str, *, blocking: bool) -> NumberedOutbox:
        """Return this participant's sender on a channel, the same for every call.

        A blocking one waits for slow receivers; the other drops what they do not take in time.
        """
        if channel not in self._numbered:
            publisher = self._publisher(channel, blocking)
            self._numbered[channel] = NumberedOutbox(publisher, self.lead(channel, self._role))
        return self._numbered[channel]

    def inbox(self, channel: str, senders: Iterable[str], *, complete: bool = True) -> NumberedInbox:
        """Return a receiver of the messages of these senders. `complete`: none may be missing."""
        screen = NumberScreen((self.lead(channel, sender) for sender in senders), complete)
        return NumberedInbox(self._subscribed(channel, zenoh.handlers.FifoChannel(DEPTH)), screen)

    def tick_outbox(self, channel: str, *, blocking: bool) -> Outbox:
        """Return a sender of messages with one tick each, which bring their frame along."""
        return Outbox(self._publisher(channel, blocking), self.lead(channel, self._role))

    def tick_inbox(self, channel: str) -> Inbox:
        """Return a receiver of whatever is sent on a channel with one message per tick; a `TickScreen` judges it."""
        return self._subscribed(channel, zenoh.handlers.FifoChannel(DEPTH))

    def _publisher(self, channel: str, blocking: bool) -> Any:
        control = zenoh.CongestionControl.BLOCK if blocking else zenoh.CongestionControl.DROP
        return self._session.declare_publisher(f"{self._root}/{channel}", express=True, congestion_control=control)

    def _subscribed(self, channel: str, handler: Any) -> Inbox:
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
