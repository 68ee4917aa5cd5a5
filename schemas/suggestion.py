"""Advice about a name that is not known: the one that was probably meant, or what there is."""

from collections.abc import Iterable
from difflib import get_close_matches

MOST = 12
"""Most names that are listed."""


def meant(name: str, known: Iterable[str]) -> str:
    """Write ` (did you mean 'start'?)`; empty if no name is like this one."""
    near = get_close_matches(name, sorted(known), n=1, cutoff=0.75)
    return f" (did you mean {near[0]!r}?)" if near else ""


def suggestion(name: str, known: Iterable[str], none: str = "known: none") -> str:
    """Write `did you mean 'can'?`, or `known: can, cup` if no name is like this one.

    none: what to write if there is no name at all.
    """
    names = sorted(known)
    if not names:
        return none
    if near := get_close_matches(name, names, n=1):
        return f"did you mean {near[0]!r}?"
    return f"known: {', '.join(names[:MOST])}{', ...' if len(names) > MOST else ''}"
