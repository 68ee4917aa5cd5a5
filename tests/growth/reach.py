"""What can be reached from things that run, and how large it is: by the attributes that lead there, knowing no class.

    before = sizes({"robot": robot}, limits)
    ...
    for growth in grown(before, sizes({"robot": robot}, limits)): print(growth)

Containers that are reached in the same way count as one: `robot._nets[*].places` is the length of all together.
A container that has a limit of its own, and keeps it, is no growth while it fills up; what is in it counts as if it
held one thing, the average of all.
Python's own tool (`gc.get_referents`) shows what an object of C holds; there the name of its type stands for an
attribute.
"""

import asyncio
import contextlib
import functools
import gc
import inspect
import logging
import sys
import types
from collections import Counter, defaultdict, deque
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

CONTAINERS = (dict, list, tuple, set, frozenset, deque)
LARGE = 1024
"""Text and bytes count from this length on: a name that differs by a letter is no growth."""
OURS = "engage_hri"
CLOSED = (types.BuiltinFunctionType, types.FrameType, types.TracebackType, types.CodeType, logging.Handler)
"""What is not opened: it holds the whole of Python, or what the test itself keeps."""


class Growth(NamedTuple):
    """A measure that has grown. path: attributes that lead there, or a type whose instances were counted."""

    path: str
    before: int
    after: int

    def __str__(self) -> str:
        return f"{self.path}: {self.before} -> {self.after}"


def modules() -> dict[str, object]:
    """Our modules that are loaded, as roots: tables, caches and counters live there."""
    return {name.removeprefix(f"{OURS}."): one for name, one in sorted(sys.modules.items()) if _is_ours(name)}


def running() -> dict[str, object]:
    """All tasks of the loop but this one, and the loop's timers, as roots."""
    loop, own = asyncio.get_running_loop(), asyncio.current_task()
    tasks = {f"task {task.get_name()}": task for task in asyncio.all_tasks() if task is not own}
    return {**dict(sorted(tasks.items())), "loop": loop}


def sizes(roots: Mapping[str, object], limits: Mapping[str, int] = MappingProxyType({})) -> Counter[str]:
    """Lengths of all containers, texts and arrays that are reached, by path; instances of our classes, by class.

    An object counts where it is reached by the fewest steps, and once.
    limits: by attribute, the length that such a container has at most; a deque and a cache know theirs themselves.
    """
    gc.collect()
    found = defaultdict[str, float](float)
    seen = {id(sys.modules), id(found), id(roots), id(limits)}
    with contextlib.suppress(RuntimeError):  # there is no loop
        seen.add(id(asyncio.current_task()))
    waiting = deque((name, one, 1.0) for name, one in roots.items())
    kept = list[object]()
    """Attributes are made anew when they are asked for: an address must not be used twice meanwhile."""
    while waiting:
        path, one, weight = waiting.popleft()
        if id(one) in seen or _is_closed(one):
            continue
        seen.add(id(one))
        kept.append(one)
        size = _size(one)
        most = _limit(one, path, limits)
        if size and most is not None and size <= most:
            weight /= size
        elif size is not None:
            found[path] += weight * size
        if _is_ours(type(one).__module__):
            found[f"instances of {type(one).__module__.removeprefix(f'{OURS}.')}.{type(one).__qualname__}"] += weight
        waiting.extend((path + step, each, weight) for step, each in _within(one) if not _is_plain(each))
    return Counter({path: round(size) for path, size in found.items()})


def _limit(one: Any, path: str, limits: Mapping[str, int]) -> int | None:
    """Length that a container has at most; None: nobody says so."""
    if isinstance(one, deque):
        return one.maxlen
    if isinstance(one, functools._lru_cache_wrapper):
        return one.cache_parameters()["maxsize"]
    return limits.get(path.rpartition(".")[2])


def grown(before: Mapping[str, int], after: Mapping[str, int], slack: int, share: float = 0.02) -> list[Growth]:
    """What has grown by more than a number and a share of itself, the largest first."""
    found = [Growth(path, before.get(path, 0), size) for path, size in after.items()]
    return sorted(
        (one for one in found if one.after > (1 + share) * one.before + slack), key=lambda one: one.before - one.after
    )


def _is_ours(module: object) -> bool:
    return isinstance(module, str) and (module == OURS or module.startswith(f"{OURS}."))


def _is_closed(one: object) -> bool:
    """Whether it is not opened. A class of ours is: it may keep something in an attribute."""
    return isinstance(one, CLOSED) or (isinstance(one, type) and not _is_ours(one.__module__))


def _is_plain(one: object) -> bool:
    is_short = isinstance(one, str | bytes) and len(one) < LARGE
    return one is None or is_short or isinstance(one, int | float | complex)


def _size(one: Any) -> int | None:
    if isinstance(one, (*CONTAINERS, types.MappingProxyType)):
        return len(one)
    if isinstance(one, str | bytes | bytearray | memoryview):
        return len(one)
    if type(one).__module__ == "numpy" and hasattr(one, "nbytes"):
        return int(one.nbytes)
    if isinstance(one, functools._lru_cache_wrapper):
        return one.cache_info().currsize
    return None


def _within(one: Any) -> Iterator[tuple[str, object]]:
    """What an object holds, each with the step that leads to it."""
    if isinstance(one, types.ModuleType):
        if _is_ours(one.__name__):
            variables = vars(one).items()
            own = ((name, each) for name, each in variables if not name.startswith("__"))  # no loader: it is pytest
            yield from ((f".{name}", each) for name, each in own if not isinstance(each, types.ModuleType))
    elif isinstance(one, type):
        yield from ((f".{name}", each) for name, each in vars(one).items() if isinstance(each, CONTAINERS))
    elif isinstance(one, dict):
        yield from (("[key]", each) for each in one)
        yield from (("[*]", each) for each in one.values())
    elif isinstance(one, CONTAINERS):
        yield from (("[*]", each) for each in one)
    elif isinstance(one, types.FunctionType):
        names = one.__code__.co_freevars
        for name, cell in zip(names, one.__closure__ or (), strict=True):
            with contextlib.suppress(ValueError):  # it is empty
                yield f".<{name}>", cell.cell_contents
        yield from ((".<default>", each) for each in one.__defaults__ or ())
        if (wrapped := one.__dict__.get("__wrapped__")) is not None:
            yield ".__wrapped__", wrapped
    elif isinstance(one, functools._lru_cache_wrapper):
        if one.cache_parameters()["maxsize"] is None:
            yield from ((".<cached>", each) for each in gc.get_referents(one) if isinstance(each, dict))
        yield ".__wrapped__", one.__wrapped__
    elif isinstance(one, types.MethodType):
        yield "", one.__self__
        yield "", one.__func__
    elif inspect.iscoroutine(one) or inspect.isgenerator(one) or inspect.isasyncgen(one):
        frame = getattr(one, "cr_frame", None) or getattr(one, "gi_frame", None) or getattr(one, "ag_frame", None)
        if frame is not None:
            yield from ((f"({one.__qualname__}).{name}", each) for name, each in list(frame.f_locals.items()))
        for each in gc.get_referents(one):  # also what it awaits, and what has no name
            yield f"({one.__qualname__})", each
    else:
        named = dict(_attributes(one))
        yield from ((f".{name}", each) for name, each in named.items())
        known = {id(each) for each in named.values()}
        for each in gc.get_referents(one):
            if id(each) not in known and each is not getattr(one, "__dict__", None):
                yield f".<{type(each).__name__}>", each


def _attributes(one: object) -> Iterator[tuple[str, object]]:
    yield from list(getattr(one, "__dict__", {}).items())
    for owner in type(one).__mro__:
        slots = owner.__dict__.get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            private = name.startswith("__") and not name.endswith("__")
            name = f"_{owner.__name__.lstrip('_')}{name}" if private else name
            if name not in ("__dict__", "__weakref__") and (each := getattr(one, name, None)) is not None:
                yield name, each
    for name in getattr(type(one), "__struct_fields__", ()):
        yield name, getattr(one, name)
