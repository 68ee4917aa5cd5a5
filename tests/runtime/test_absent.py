"""Who has gone, and when to forget them, against a table of all that ever happened."""

from hypothesis import given
from hypothesis import strategies as st

from engage_hri.services.bus.deadlines import FORGOTTEN_AFTER, Absent, Acquaintances

NAMES = "abcd"
STEPS = st.lists(
    st.tuples(st.integers(0, 400), st.sampled_from(["leaves", "comes", "forgotten"]), st.sampled_from(NAMES))
)


@given(STEPS)
def test_exactly_those_are_forgotten_who_have_been_away_for_as_long_as_is_stated(
    steps: list[tuple[int, str, str]],
) -> None:
    absent, since, now = Absent[str](), dict[str, int](), 0
    for pause, what, name in steps:
        now += pause
        if what == "leaves":
            absent.leaves(name, now)
            since[name] = now
        elif what == "comes":
            absent.comes(name)
            since.pop(name, None)
        else:
            gone = {each for each, at in since.items() if now - at >= FORGOTTEN_AFTER}
            assert set(absent.forgotten(now)) == gone
            since = {each: at for each, at in since.items() if each not in gone}
        assert dict(absent.latest()) == since
        assert [at for _, at in absent.latest()] == sorted(since.values(), reverse=True)


def test_nobody_is_forgotten_who_is_in_the_world_however_long_nothing_is_told_of_them() -> None:
    people = Acquaintances()
    people.see(["ann", "ben"], 0.0)
    people.hear("ann", 1.0)
    people.see(["ann"], 10.0)

    assert people.forgotten(9 + FORGOTTEN_AFTER) == []
    assert people.forgotten(10 + FORGOTTEN_AFTER) == ["ben"]
    assert people.forgotten(10 * FORGOTTEN_AFTER) == []


def test_of_whom_only_others_tell_the_last_sign_counts() -> None:
    people = Acquaintances()
    people.hear("ann", 0.0)
    people.hear("ben", 1.0)
    people.hear("ann", 2.0)

    assert people.forgotten(1 + FORGOTTEN_AFTER) == ["ben"]
    assert people.forgotten(2 + FORGOTTEN_AFTER) == ["ann"]
