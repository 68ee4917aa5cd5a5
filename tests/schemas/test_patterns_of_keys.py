"""Key expressions: which keys `*` and `**` include, against all ways to take an expression apart."""

from hypothesis import example, given
from hypothesis import strategies as st

from engage_hri.schemas import keys

CHUNKS = st.sampled_from(["a", "b", "@bus", "*", "**"])
NAMES = st.sampled_from(["a", "b", "@bus"])


def expanded(pattern: list[str], length: int) -> list[list[str]]:
    """The expression with each `**` written as none, one, two ... `*`."""
    if not pattern:
        return [[]]
    heads = [["*"] * count for count in range(length + 1)] if pattern[0] == "**" else [[pattern[0]]]
    return [[*head, *rest] for head in heads for rest in expanded(pattern[1:], length)]


@given(st.lists(CHUNKS, min_size=1, max_size=4), st.lists(NAMES, min_size=1, max_size=5))
@example(["a", "**", "b"], ["a", "b", "b"])
@example(["**", "b"], ["a", "b"])
@example(["**", "a", "**"], ["b", "a"])
def test_an_expression_includes_the_keys_that_one_of_its_expansions_includes(
    pattern: list[str], key: list[str]
) -> None:
    one_by_one = (each for each in expanded(pattern, len(key)) if len(each) == len(key))
    expected = any(
        all(part == name or (part == "*" and name[0] != "@") for part, name in zip(each, key, strict=True))
        for each in one_by_one
    )

    assert keys.matches("/".join(pattern), "/".join(key)) is expected
