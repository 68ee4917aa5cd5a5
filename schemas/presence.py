"""Who is on the bus. These two never travel: each bus makes them from liveliness, for its own subscribers."""

from msgspec import Struct


class PeerAlive(Struct, frozen=True, kw_only=True, tag="peer_alive"):
    """run: which life of it this is; after a restart another one. Empty: unknown."""

    participant: str
    run: str = ""


class PeerGone(Struct, frozen=True, kw_only=True, tag="peer_gone"):
    participant: str
