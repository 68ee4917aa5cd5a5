"""The policies of the head in their order, the strongest first. A new one is a file, and a line here. Pure."""

from collections.abc import Mapping

from engage_hri.services.generation.head.aversion_policy import AversionPolicy
from engage_hri.services.generation.head.continuer_policy import ContinuerPolicy
from engage_hri.services.generation.head.listening_policy import ListeningPolicy
from engage_hri.services.generation.head.maintenance_policy import FaceWatch, GlanceWatch, HandWatch
from engage_hri.services.generation.head.mutual_policy import MutualGazePolicy
from engage_hri.services.generation.head.nod_policy import NodPolicy
from engage_hri.services.generation.head.orders import FragmentPolicy, InhibitionPolicy
from engage_hri.services.generation.head.policy import HeadPolicy
from engage_hri.services.generation.head.response_policy import ResponsePolicy
from engage_hri.services.generation.head.trunk_policy import TrunkPolicy

OWN: Mapping[str, type[HeadPolicy]] = {
    "inhibition": InhibitionPolicy,
    "fragment": FragmentPolicy,
    "glance": GlanceWatch,
    "aversion": AversionPolicy,
    "response": ResponsePolicy,
    "mutual": MutualGazePolicy,
    "listening": ListeningPolicy,
    "hands": HandWatch,
    "face": FaceWatch,
    "continuers": ContinuerPolicy,
    "nods": NodPolicy,
    "trunk": TrunkPolicy,
}
ORDERS = "inhibition", "fragment"
"""Policies that cannot be switched off: somebody has ordered what they claim."""
