"""Limits of a requester. Pure."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds


class Patience(Struct, frozen=True, kw_only=True):
    """Limits of a requester, times in seconds.

    first_resend: until a request that nobody has answered is sent again; the wait doubles up to longest_resend.
    grace: how long the server may be gone before its requests fail: a restart of the router looks like a death. By
    then it has ended them, if it lives: it misses us a silent link's lease later than we miss it, and has its grace.
    pulse: between two `KeepAlive`. lease: how long a request that is not renewed stays alive at its server.
    cancel: how long after its cancellation a request may take to end. silence: how long a server that is there may
    leave a request without any answer. swallow: how long late answers to a request that was given up are ignored.
    window: number of requests that a server may have before it without an answer; more wait here.
    """

    first_resend: Seconds = 0.3
    longest_resend: Seconds = 2.0
    grace: Seconds = 4.0
    pulse: Seconds = 1.0
    lease: Seconds = 5.0
    cancel: Seconds = 30.0
    silence: Seconds = 30.0
    swallow: Seconds = 60.0
    window: int = 64
