"""How many random cases a test tries: a share in `make test`, all in `make test-long`.

Tests that take more than a third of a second ask here, and seeds that are a test each: pytest takes 6 ms for one,
whatever it does. Who takes less gains nothing, and a share of the examples of such a test once passed over a mistake
that all of them find. A share begins like the whole: what fails in it fails in the whole, too.
"""

from hypothesis import settings

SHARE = 12
"""`make test` tries one of so many cases, the first ones."""


def share_of(whole: int, one_of: int = SHARE) -> int:
    """Number of random cases to try, of so many in all. The profile of Hypothesis decides (`conftest.py`).

    one_of: the share that `make test` tries, where the whole takes minutes.
    """
    match settings.get_current_profile_name():
        case "same":
            return -(-whole // one_of)
        case "map":  # which lines run (tests/mutants)
            return 1
    return whole


def trials() -> int | None:
    """Number of random trials of each law, of a body that takes long to try; None: all. For `BodyContract.seeds`."""
    return 1 if settings.get_current_profile_name() in ("same", "map") else None
