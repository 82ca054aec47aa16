from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hilrig.core.parameters import plain

VALUES = [
    (np.float32(0.5), 0.5),
    (np.float64(0.1), 0.1),
    (np.longdouble(0.5), 0.5),
    (np.int64(3), 3),
    (np.uint8(3), 3),
    (np.bool_(True), True),
    (np.str_("x"), "x"),
    (np.array(2.5), 2.5),
    (np.array([1.0, 2.0]), (1.0, 2.0)),
    (np.array([[1, 2], [3, 4]]), ((1, 2), (3, 4))),
    ((np.float32(0.5), 1), (0.5, 1)),
    (np.inf, float("inf")),
    (None, None),
]


def types_of(value: Any) -> Any:
    return [types_of(item) for item in value] if isinstance(value, tuple) else type(value)


@pytest.mark.parametrize(("value", "wanted"), VALUES, ids=[repr(value) for value, _ in VALUES])
def test_values_of_numpy_become_pythons(value: Any, wanted: Any) -> None:
    assert plain(value) == wanted
    assert types_of(plain(value)) == types_of(wanted)
