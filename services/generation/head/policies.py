"""The policies of the head in their order, the strongest first: ours, and those of installed packages."""

from collections.abc import Mapping

from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.aversion_policy import AversionPolicy
from engage_hri.services.generation.head.listening_policy import ListeningPolicy
from engage_hri.services.generation.head.maintenance_policy import FaceWatch, GlanceWatch, HandWatch
from engage_hri.services.generation.head.mutual_policy import MutualGazePolicy
from engage_hri.services.generation.head.nod_policy import NodPolicy
from engage_hri.services.generation.head.orders import FragmentPolicy, InhibitionPolicy
from engage_hri.services.generation.head.policy import HeadPolicy
from engage_hri.services.generation.head.response_policy import ResponsePolicy

Policies = Mapping[str, type[HeadPolicy]]
"""Policies by their names, in their order."""
OWN: Policies = {
    "inhibition": InhibitionPolicy,
    "fragment": FragmentPolicy,
    "glance": GlanceWatch,
    "aversion": AversionPolicy,
    "response": ResponsePolicy,
    "mutual": MutualGazePolicy,
    "listening": ListeningPolicy,
    "hands": HandWatch,
    "face": FaceWatch,
    "nods": NodPolicy,
}
ORDERS = "inhibition", "fragment"
"""Policies that cannot be switched off: somebody has ordered what they claim."""
WHERE = "generation.policies_off"


def arranged(config: GenerationConfig, others: Policies) -> Policies:
    """The policies to follow. others: of installed packages, by their names; one of our names replaces ours.

    Raises InputRefused: a policy comes before one that there is not, or one is switched off that there is not.
    """
    order = [*OWN]
    for name, policy in others.items():
        if name in order:
            continue
        if policy.before not in order:
            reason = f"policy {name!r} is to come before {policy.before!r}, and there is none"
            raise _refusal(reason, policy.before, order, name)
        order.insert(order.index(policy.before), name)
    for name in config.policies_off:
        if name not in order:
            raise _refusal(f"no policy {name!r}", name, order, WHERE)
        if name in ORDERS:
            reason = f"policy {name!r} cannot be off: it does what somebody has ordered"
            raise InputRefused(Fault(reason=reason, where=WHERE))
    known = {**OWN, **others}
    return {name: known[name] for name in order if name not in config.policies_off}


def _refusal(reason: str, name: str, order: list[str], where: str) -> InputRefused:
    advice = suggestion(name, order) or f"one of {', '.join(order)}"
    return InputRefused(Fault(reason=reason, where=where, advice=advice))
