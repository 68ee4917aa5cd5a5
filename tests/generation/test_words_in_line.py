"""Words come in the order of the document, whatever is tied to them."""

import pytest

from engage_hri.schemas.behaviors import Constraint, Head, Mark, Synchronize
from engage_hri.schemas.fragments import TurnFragment
from tests.generation.emitted import LOOK, block, lines, reference, speech


@pytest.mark.parametrize("point", ["t:m", "t:end"])
def test_words_that_something_is_tied_to_still_follow_those_before_them(point: str) -> None:
    tied = Constraint(id="c", operators=(Synchronize(ref=point, syncs=("n:stroke",)),))
    behaviors = (
        speech("s"),
        reference("r"),
        speech("t", "on the right", marks=(Mark("m", 7),)),
        Head(id="n", lexeme="NOD"),
    )

    result = block(TurnFragment(id="f", behaviors=behaviors, constraints=(tied,)), [(LOOK, "the cup")])

    assert "t:start after r-phrase:end" in lines(result)
