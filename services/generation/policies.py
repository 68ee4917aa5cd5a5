"""Policies of the head and of turns together: those that installed packages offer, and those that are off. Pure."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.followed import unknown
from engage_hri.services.generation.head.policies import ORDERS
from engage_hri.services.generation.head.policies import OWN as OF_THE_HEAD
from engage_hri.services.generation.head.policy import HeadPolicy
from engage_hri.services.generation.turns.policies import OWN as OF_TURNS
from engage_hri.services.generation.turns.policy import TurnPolicy
from engage_hri.services.runtime.installation import HEAD_POLICIES, TURN_POLICIES, offers

WHERE = "generation.policies_off"


class Policies(NamedTuple):
    """Policies of others by their names."""

    head: Mapping[str, type[HeadPolicy]] = {}
    turns: Mapping[str, type[TurnPolicy]] = {}


def installed(config: GenerationConfig) -> Policies:
    """Import the policies that installed packages offer, but those that are off.

    Raises InputRefused: one cannot be imported, or one is off that there is not, or that must not be.
    """
    others = Policies(_imported(HEAD_POLICIES, config), _imported(TURN_POLICIES, config))
    offered = [offer.name for group in (HEAD_POLICIES, TURN_POLICIES) for offer in offers(group)]
    names = [*OF_THE_HEAD, *OF_TURNS, *offered]
    for name in config.policies_off:
        if name not in names:
            raise unknown(f"no policy {name!r}", name, names, WHERE)
        if name in ORDERS:
            reason = f"policy {name!r} cannot be off: it does what somebody has ordered"
            raise InputRefused(Fault(reason=reason, where=WHERE))
    return others


def _imported(group: str, config: GenerationConfig) -> dict[str, Any]:
    policies = {}
    for offer in offers(group):
        if offer.name not in config.policies_off:
            try:
                policies[offer.name] = offer.load()
            except Exception as error:
                what = f"policy {offer.name!r} of {offer.package} cannot be imported: {error}"
                advice = offer.advice(error) or f"{WHERE} = [{offer.name!r}] goes without it"
                raise InputRefused(Fault(reason=what, where=WHERE, advice=advice)) from error
    return policies
