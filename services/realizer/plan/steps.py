"""Work that can be done a piece at a time: a generator that pauses, so that others may have their turn in between.

`yield n` says that about `n` elements have been looked at since the last pause, or will be until the next: some two
microseconds each.
What is worked on must not change meanwhile. `finished` does it all in one go.
"""

from collections.abc import Collection, Generator, Iterator, Sequence
from typing import TypeVar

T = TypeVar("T")

Steps = Generator[int, None, T]
"""Returns what the work is for."""

PORTION = 64
"""Of a block's elements that are looked at between two pauses."""


def finished(steps: Steps[T]) -> T:
    """Without a pause."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            result: T = end.value
            return result


def portions(elements: Collection[T], size: int = PORTION) -> Iterator[Sequence[T]]:
    """`elements` in order, so many at a time."""
    listed = elements if isinstance(elements, list | tuple) else tuple(elements)
    return (listed[since : since + size] for since in range(0, len(listed), size))
