"""Long work a piece at a time: a generator that pauses, so that other work may have its turn in between.

`yield n` says that about `n` elements have been looked at since the last pause, or will be until the next: some two
microseconds each. What is worked on must not change meanwhile. `finished` does it all in one go.
"""

from collections.abc import Callable, Generator
from typing import ParamSpec, TypeVar

T = TypeVar("T")
P = ParamSpec("P")

Steps = Generator[int, None, T]
"""Work in steps; returns its result."""

SLICE = 512
"""Elements that are worked on in one go: one to five milliseconds. Counted: equal runs stay equal."""


def finished(steps: Steps[T]) -> T:
    """The result of the work, done without a pause."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            result: T = end.value
            return result


def in_one_go(work: Callable[P, Steps[T]]) -> Callable[P, T]:
    """The same work as a plain function."""
    return lambda *args, **rest: finished(work(*args, **rest))
