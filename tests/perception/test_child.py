"""Messages through the pipes of a child process, in whatever pieces they come."""

import pytest
from msgspec import Struct

from engage_hri.services.perception.child import PackedMessages, packed_message


class Told(Struct, tag=True):
    text: str


@pytest.mark.parametrize("piece", [1, 3, 7, 1000])
def test_messages_are_the_same_whatever_the_pieces_in_which_they_come(piece: int) -> None:
    sent = [Told("ab" * number) for number in (0, 1, 5, 300)]
    packed = b"".join(map(packed_message, sent))
    reader = PackedMessages(Told)

    assert [
        message for at in range(0, len(packed), piece) for message in reader.take(packed[at : at + piece])
    ] == sent
