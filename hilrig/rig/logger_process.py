"""The logger's process: records what is on the bus, off the control path."""

from __future__ import annotations

from hilrig.errors import Stopped
from hilrig.recording.old_timing import summarise_batches
from hilrig.recording.recorder import Recorder
from hilrig.recording.run_directory import trial_path, write_json
from hilrig.rig.bus import Inbox
from hilrig.rig.channels import NAMES, channels, unpack_parcel
from hilrig.rig.child import Child, main


def work(child: Child) -> None:
    """Record until every sender has said that it sent its last message, or until stopped."""
    parcels = child.bus.inbox("record")
    order = child.ready(("driver", "controller"))
    directory = trial_path(child.run, child.orders.trial)
    with Recorder(directory, order["period"], channels(order["memory"])) as recorder:
        try:
            record(parcels, recorder)
        except Stopped:
            record_rest(parcels, recorder)
        write_json(directory / "timing.json", summarise_batches(order["clock"], recorder.timing))
        summary = recorder.summary()
    child.tell("done", channels=summary)


def record(parcels: Inbox, recorder: Recorder) -> None:
    """Record until all channels have ended."""
    still_open = set(NAMES)
    while still_open:
        still_open -= store(recorder, parcels.take())


def record_rest(parcels: Inbox, recorder: Recorder) -> None:
    """Record what has already arrived."""
    while (parcel := parcels.poll()) is not None:
        store(recorder, parcel)


def store(recorder: Recorder, parcel: bytes) -> set[str]:
    """Record one parcel; return the channels that end in it."""
    ended: set[str] = set()
    for name, payload, count in unpack_parcel(parcel):
        if count is None:
            recorder.store(name, payload)
        else:
            recorder.sent(name, count)
            ended.add(name)
    return ended


if __name__ == "__main__":
    main(work)
