"""Whether a state still has its publisher."""

from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.services.reports.in_force import Publisher

NEWS = st.sampled_from(["publishes", "comes", "goes"])
STEPS = st.lists(st.tuples(NEWS, st.sampled_from("ab"), st.sampled_from("12")))


@given(STEPS)
def test_a_state_is_known_while_the_life_that_published_it_last_is_not_known_to_be_gone(
    steps: list[tuple[str, str, str]],
):
    publisher = Publisher()

    for count, (what, name, run) in enumerate(steps, 1):
        was = publisher.is_there
        if what == "publishes":
            publisher.published(name, run)
        else:
            alive, gone = PeerAlive(participant=name, run=run), PeerGone(participant=name)
            is_back = publisher.feed(alive if what == "comes" else gone)
            assert is_back == (publisher.is_there and not was)
        assert publisher.is_there == _is_known(steps[:count])


def _is_known(steps: list[tuple[str, str, str]]) -> bool:
    """The same, from the whole story: of the last news about its publisher, the newest."""
    published = [number for number, step in enumerate(steps) if step[0] == "publishes"]
    if not published:
        return False
    _, name, run = steps[published[-1]]
    later = [step for step in steps[published[-1] + 1 :] if step[1] == name]
    return not later or later[-1] == ("comes", name, run)
