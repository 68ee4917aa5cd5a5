"""Presence of participants on the bus. Each bus makes these messages from liveliness; they never travel."""

import re

from msgspec import Struct

_CLAIM = re.compile(r"(?:.*[-.])?seat-[0-9a-f]{8}-.+")
"""Name of a participant that is only shown to claim something; with keys, that of its holder stands before it."""


def is_claim(participant: str) -> bool:
    """True if a participant only claims something, which is a seat. It answers and does nothing."""
    return _CLAIM.fullmatch(participant) is not None


class PeerAlive(Struct, frozen=True, kw_only=True, tag="peer_alive"):
    """A participant has come onto the bus.

    run: id of this life of the participant; after a restart it is another one. Empty: unknown.
    """

    participant: str
    run: str = ""


class PeerGone(Struct, frozen=True, kw_only=True, tag="peer_gone"):
    """A participant has left the bus."""

    participant: str
