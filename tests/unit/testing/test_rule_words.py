"""How a rule tells numbers apart."""

from __future__ import annotations

import numpy as np
import pytest

from hilrig.testing.rule import Broken, require


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        (1.0, 2.0, "1 and 2"),
        (1.0, 1.0 + 1e-7, "1 and 1.0000001"),
        (np.array([3.0, 1.0]), np.array([3.0, 1.0 + 2**-52]), "[3, 1] and [3, 1.0000000000000002]"),
        (1.0, 1.0, "1 and 1"),
    ],
)
def test_two_values_are_shown_with_digits_enough_to_differ(one: object, other: object, words: str) -> None:
    with pytest.raises(Broken) as caught:
        require(False, "{} and {}", one, other)
    assert str(caught.value) == words
