"""Every message there is, and values for it, as hypothesis draws them."""

from __future__ import annotations

from importlib import resources

import numpy as np
from hypothesis import strategies as st

from hilrig.recording.messages.codec import Codec, Definition, definition, extended

MESSAGES = tuple(
    sorted(
        file.name.removesuffix(".msg")
        for file in resources.files("hilrig.recording.messages").iterdir()
        if file.name.endswith(".msg")
    )
)
numbers = st.floats(allow_nan=False)


def full(name: str) -> Definition:
    """Return the definition as it is used: a law's memory behind the internals."""
    return (
        extended(definition(name), {"gains": 3, "one": 1, "estimate": 2}) if name == "Internals" else definition(name)
    )


@st.composite
def messages(draw: st.DrawFn, name: str) -> tuple[Codec, list]:
    """A codec with lengths of its own for every sequence, and values to fit."""
    form = full(name)
    sizes = {field.name: draw(st.integers(0, 5)) for field in form.fields if field.size == 0}
    values: list = []
    for field in form.fields:
        whole = st.integers(0, 2**64 - 1) if field.type == "uint64" else st.integers(-(2**63), 2**63 - 1)
        element = numbers if field.type == "float64" else whole
        kind = {"float64": np.float64, "int64": np.int64, "uint64": np.uint64}[field.type]
        count = sizes.get(field.name, field.size)
        values.append(
            draw(element) if count is None else np.array(draw(st.lists(element, min_size=count, max_size=count)), kind)
        )
    return Codec(form, sizes), values
