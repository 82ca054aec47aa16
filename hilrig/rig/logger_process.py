"""The logger process: records what is sent on the bus, outside the control loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hilrig.core.errors import Stopped
from hilrig.experiment.timing_budget import TimingBudget
from hilrig.recording.messages.layouts import definitions
from hilrig.recording.recorder import Recorder, added
from hilrig.recording.run_directory import read_trial_document, trial_path, write_json
from hilrig.recording.timing import certify, terms_of
from hilrig.rig.bus import NumberedInbox
from hilrig.rig.channels import NAMES, unpack_batches
from hilrig.rig.child import Child, main
from hilrig.rig.view_maker import Views


def work(child: Child) -> None:
    """Record until every sender has sent its last packet, or until stopped."""
    packets = child.bus.inbox("record", ["driver", "controller"])
    trial = read_trial_document(child.run, child.orders.trial)
    views = Views(child.bus, trial)
    order = child.ready(("driver", "controller"))
    directory = trial_path(child.run, child.orders.trial)
    with Recorder(directory, trial["period"], definitions(order["memory"])) as recorder:
        try:
            record_all(packets, recorder, views)
        except Stopped:
            record_rest(packets, recorder, views)
        views.end()
        budget = TimingBudget(**trial["timing"])
        refused = {**recorder.refused, "record": packets.refused}
        refused["order"] = added(refused.get("order", {}), child.refused_orders)
        timing = certify(
            terms_of(trial),
            budget,
            recorder.timing(),
            order["setup"],
            refused=refused,
            answered_to_the_end=recorder.ended("controller_timing"),
        )
        write_json(directory / "timing.json", timing)
        summary = recorder.summary()
    child.tell("done", channels=summary)


def record_all(packets: NumberedInbox, recorder: Recorder, views: Views) -> None:
    """Record until every channel has ended."""
    still_open = set(NAMES)
    while still_open:
        still_open -= store(packets, recorder, views, packets.take())


def record_rest(packets: NumberedInbox, recorder: Recorder, views: Views) -> None:
    """Record what has already arrived."""
    while (packet := packets.poll()) is not None:
        store(packets, recorder, views, packet)


def store(packets: NumberedInbox, recorder: Recorder, views: Views, packet: bytes) -> set[str]:
    """Record one packet; return the channels that end with it. One that cannot be read is counted as refused."""
    ended: set[str] = set()
    fresh: dict[str, NDArray[np.uint8]] = {}
    try:
        parts = unpack_batches(packet)
    except ValueError:
        packets.refuse()
        return ended
    for part in parts:
        if part.refused is not None:
            recorder.note_refused(part.refused)
        elif part.total is not None:
            recorder.sent(part.channel, part.total)
            ended.add(part.channel)
        else:
            recorder.store(part.channel, part.payloads)
            fresh[part.channel] = part.payloads
    recorder.write()
    views.note(fresh)
    return ended


if __name__ == "__main__":
    main(work)
