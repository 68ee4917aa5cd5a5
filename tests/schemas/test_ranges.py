"""Which numbers each check of a configuration takes, at its edges."""

from collections.abc import Callable
from math import inf, nan
from types import SimpleNamespace

import pytest

from engage_hri.schemas import units

CHECKS = (units.positive, units.not_negative, units.shares, units.inner_shares)


def is_taken(check: Callable[..., None], value: float) -> bool:
    try:
        check(SimpleNamespace(late=value), ["late"])
    except ValueError:
        return False
    return True


@pytest.mark.parametrize(
    ("value", "taken"),
    [
        (-1.0, [False, False, False, False]),
        (0.0, [False, True, True, False]),
        (0.5, [True, True, True, True]),
        (1.0, [True, True, True, False]),
        (2.0, [True, True, False, False]),
        (inf, [False] * 4),
        (nan, [False] * 4),
    ],
)
def test_each_check_takes_what_its_name_says(value: float, taken: list[bool]) -> None:
    assert [is_taken(check, value) for check in CHECKS] == taken
