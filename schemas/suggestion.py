"""Advice about a name that is not known: the one that was probably meant, or what there is."""

from collections.abc import Iterable
from difflib import get_close_matches

MOST = 12
"""Most names that are listed."""


def meant(name: str, known: Iterable[str]) -> str:
    """Write ` (did you mean 'start'?)`; empty if no name is like this one."""
    near = _nearest(name, sorted(known), 0.75)
    return f" (did you mean {near}?)" if near else ""


def suggestion(name: str, known: Iterable[str], none: str = "known: none") -> str:
    """Write `did you mean 'can'?`, or `known: can, cup` if no name is like this one.

    none: what to write if there is no name at all.
    """
    names = sorted(known)
    if not names:
        return none
    if near := _nearest(name, names, 0.6):
        return f"did you mean {near}?"
    return f"known: {', '.join(names[:MOST])}{', ...' if len(names) > MOST else ''}"


def in_other_letters(name: str, known: Iterable[str]) -> str:
    """The one known name that is this one but for capital letters; empty: there is none, or several."""
    same = [each for each in known if each.casefold() == name.casefold()]
    return same[0] if len(same) == 1 else ""


def _nearest(name: str, names: list[str], cutoff: float) -> str:
    """The name that is most like this one, or all that differ from it only in case, in quotes; empty if none is."""
    near = get_close_matches(name.casefold(), [each.casefold() for each in names], n=1, cutoff=cutoff)
    return " or ".join(repr(each) for each in names if each.casefold() in near)
