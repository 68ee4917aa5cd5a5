"""What a thing keeps in memory: everything that can be reached from it, counted and weighed."""

import gc
import sys
from collections import Counter
from collections.abc import Iterator
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any

SHARED = (type, ModuleType, FunctionType, BuiltinFunctionType, MethodType)
"""Code, which is there but once."""


def reachable(*roots: object) -> Iterator[Any]:
    """Each object once."""
    seen: set[int] = set()
    waiting = list(roots)
    while waiting:
        one = waiting.pop()
        if id(one) not in seen and not isinstance(one, SHARED):
            seen.add(id(one))
            yield one
            waiting += gc.get_referents(one)


def kinds(*roots: object) -> Counter[str]:
    """How many of each type; of containers, how many items they hold."""
    found: Counter[str] = Counter()
    for one in reachable(*roots):
        found[type(one).__name__] += 1
        if isinstance(one, dict | list | set | tuple | frozenset):
            found[f"items of {type(one).__name__}"] += len(one)
    return found


def size(*roots: object) -> int:
    """Bytes."""
    return sum(map(sys.getsizeof, reachable(*roots)))
