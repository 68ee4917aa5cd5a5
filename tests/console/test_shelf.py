"""A shelf is what a dict is, but each of its states stays as it was."""

from hypothesis import given
from hypothesis import strategies as st

from engage_hri.services.console.shelf import BOARD, Shelf

STEPS = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 3 * BOARD), st.integers(1, 2 * BOARD)), max_size=12)
"""Which of the states so far is changed, the first name that is put, and how many are."""


@given(STEPS)
def test_any_states_made_of_one_another_are_as_many_dicts(steps: list[tuple[int, int, int]]) -> None:
    states: list[tuple[Shelf[int, str], dict[int, str]]] = [(Shelf(), {})]
    for number, (since, first, count) in enumerate(steps):
        shelf, known = states[since % len(states)]
        things = [(name, f"{name} of {number}") for name in range(first, first + count)]
        states.append((shelf.put_all(things), known | dict(things)))

    for shelf, known in states:
        assert list(shelf) == list(known.values())
        assert len(shelf) == len(known)
        assert shelf == Shelf(known.items())
        assert [shelf.get(name) for name in range(6 * BOARD)] == [known.get(name) for name in range(6 * BOARD)]
