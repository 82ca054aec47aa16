"""Two processes and a transport: one sends a request and waits for the reply, the other replies.

A script that uses only the standard library, so that any Python can run it: pair.py TRANSPORT ARGUMENTS. The transport
is a file next to this one with open_link(side, folder) -> (send, receive, close): send(bytes), receive() -> bytes waits
for the next message. The side "ping" prints the round trips on stdout as JSON.

Arguments (JSON): side ("ping" or "echo"), folder (for sockets), core, policy ("batch", "fifo", "other"), priority,
request and reply (bytes), count, warm_up (exchanges that are not counted), period (ns; 0: back to back), spin (ns
before a paced exchange that are spent awake, as the rig's clock does).
"""

import ctypes
import gc
import importlib.util
import json
import os
import signal
import sys
import threading
import time
from pathlib import Path

NUMBER = 8
"""Bytes at the start of a message that hold its number"""
END, HELLO, READY, FIRST = 1, 2, 3, 4
PR_SET_PDEATHSIG = 1
POLICIES = {"batch": os.SCHED_BATCH, "fifo": os.SCHED_FIFO, "other": os.SCHED_OTHER}


def main():
    """Run one side."""
    transport, arguments = sys.argv[1], json.loads(sys.argv[2])
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    open_link = load(transport).open_link
    os.sched_setaffinity(0, {arguments["core"]})  # before the link is opened: its threads inherit it
    send, receive, close = open_link(arguments["side"], arguments["folder"])
    gc.collect()
    gc.freeze()
    gc.disable()
    if arguments["side"] == "echo":
        echo(send, receive, arguments)
    else:
        print(json.dumps(ping(send, receive, arguments)), flush=True)
    close()


def load(transport):
    """Return the module in the file <transport>.py next to this one."""
    spec = importlib.util.spec_from_file_location(transport, Path(__file__).with_name(f"{transport}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def message(number, size):
    """Return a message of `size` bytes that begins with its number."""
    return number.to_bytes(NUMBER, "little").ljust(size, b"\0")


def number_of(received):
    """Return the number of a message."""
    return int.from_bytes(received[:NUMBER], "little")


def schedule(arguments):
    """Give all threads of this process the policy.

    Only after the sides have connected: a transport that busy-waits at its start would block the other side forever, on
    the same core at the same priority.
    """
    for thread in os.listdir("/proc/self/task"):
        os.sched_setscheduler(int(thread), POLICIES[arguments["policy"]], os.sched_param(arguments["priority"]))


def echo(send, receive, arguments):
    """Reply to every request with its number and the reply's size, until it is the last."""
    rest = bytes(arguments["reply"] - NUMBER)
    number = b""
    while number_of(number) != READY:
        number = receive()[:NUMBER]
        if number_of(number) == READY:
            schedule(arguments)
        send(number + rest)
    last = END.to_bytes(NUMBER, "little")
    while (number := receive()[:NUMBER]) != last:
        send(number + rest)


def ping(send, receive, arguments):
    """Return {"round_trips": [ns, ...], "elapsed": ns}, the elapsed time from the first request to the last reply."""
    size, warm_up, count = arguments["request"], arguments["warm_up"], arguments["count"]
    meet(send, receive, size)
    schedule(arguments)
    requests = [message(FIRST + i, size) for i in range(warm_up + count)]
    times, began, ended = exchange(send, receive, requests, arguments["period"], arguments["spin"], warm_up)
    send(message(END, size))
    return {"round_trips": times[warm_up:], "elapsed": ended - began}


def meet(send, receive, size):
    """Call until the other side replies, then receive all replies to those calls."""
    met = threading.Event()

    def call():
        while not met.is_set():
            send(message(HELLO, size))
            met.wait(0.05)

    caller = threading.Thread(target=call)
    caller.start()
    receive()
    met.set()
    caller.join()
    send(message(READY, size))
    while number_of(receive()) != READY:
        pass


def exchange(send, receive, requests, period, spin, warm_up):
    """Send each request and wait for its reply; return the round trips and when the counted ones began and ended."""
    times, began, now = [0] * len(requests), 0, time.monotonic_ns
    due = now()
    for i, request in enumerate(requests):
        if period:
            due += period
            wait_until(due, spin)
        sent = now()
        if i == warm_up:
            began = sent
        send(request)
        reply = receive()
        times[i] = now() - sent
        if reply[:NUMBER] != request[:NUMBER]:
            raise SystemExit(f"request {number_of(request)} was answered by reply {number_of(reply)}")
    return times, began, now()


def wait_until(due, spin):
    """Wait until `due`, CLOCK_MONOTONIC in ns, awake for the last `spin` ns."""
    left = due - spin - time.monotonic_ns()
    if left > 0:
        time.sleep(left / 1e9)
    while time.monotonic_ns() < due:
        pass


if __name__ == "__main__":
    main()
