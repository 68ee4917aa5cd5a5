"""Presence of participants on the bus. Each bus makes these messages from liveliness; they never travel."""

from msgspec import Struct


class PeerAlive(Struct, frozen=True, kw_only=True, tag="peer_alive"):
    """A participant has come onto the bus.

    run: id of this life of the participant; after a restart it is another one. Empty: unknown.
    """

    participant: str
    run: str = ""


class PeerGone(Struct, frozen=True, kw_only=True, tag="peer_gone"):
    """A participant has left the bus."""

    participant: str
