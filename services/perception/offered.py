"""Offers of installed packages to a sense, found by name and made: a recognizer, a source of landmarks."""

from typing import Any

from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.runtime.installation import offers


def make_offered(group: str, kind: str, name: str, settings: Any, where: str) -> Any:
    """Import what is offered under a name, and make it of its settings. kind: what it is, in words.

    Raises InputRefused, with `where`: nothing has this name, or a package is missing.
    """
    offered = offers(group)
    for offer in offered:
        if offer.name == name:
            try:
                return offer.load()(settings)
            except ImportError as error:
                raise InputRefused(Fault(reason=str(error), where=where, advice=offer.advice(error))) from error
    names = sorted({offer.name for offer in offered})
    advice = suggestion(name, names) or f"one of {', '.join(names)}"
    raise InputRefused(Fault(reason=f"no {kind} {name!r}", where=where, advice=advice))
