"""Limits of what is read and sent: how many bytes a message may have on each key, and how many may come a second.

The limits are for everybody: a bus refuses at the sender what is larger, and Zenoh drops it where it comes in
(services/bus/zenoh/sizes.py). Each is eight times or more the largest message that was measured on its key with a
thousand behaviors in a block, a thousand objects in a world, and the tangram task.
"""

from functools import lru_cache

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused

SMALL = 64 * 1024
"""Bytes of most messages; the largest measured has 6 kB."""
MEDIUM = 1024 * 1024
"""Bytes of blocks, of what is told of a whole block, of worlds, and of lists of people or requests."""
LARGEST = 4 * 1024 * 1024
"""Bytes of the largest messages, and of a document in a file, in whatever form."""
LARGEST_XML_SENT = 64 * 1024
"""Bytes of XML that is sent over the bus, some 700 behaviors. A kilobyte takes up to 1 ms to read; a server does
nothing else meanwhile, and the realizer has to renew what the body does. JSON and MessagePack take a hundredth."""
LARGER: dict[str, int] = {
    keys.NET: LARGEST, keys.FEEDBACK: LARGEST,
    keys.FRAGMENT: MEDIUM, keys.BLOCK: MEDIUM, keys.BEHAVIOR: MEDIUM, f"{keys.PREFIX}/cmd/*/*/*/keep_alive": MEDIUM,
    keys.ANY_REQUEST_STATE: MEDIUM, keys.FRAGMENT_FEEDBACK: MEDIUM, keys.ANY_TAKEN: MEDIUM, keys.WORLD: MEDIUM,
    keys.ROBOT_STATE: MEDIUM, keys.ROBOT_SEEN: MEDIUM, keys.ROBOT_ONGOING: MEDIUM, keys.ANY_OPEN_EVENTS: MEDIUM,
    keys.ANY_STATISTICS: MEDIUM, keys.ESTIMATE: MEDIUM, keys.DESCRIBE: MEDIUM, keys.status("*"): MEDIUM,
    keys.own("*", "past"): MEDIUM, keys.own("*", "counts"): MEDIUM,
}  # fmt: skip
"""Bytes of a message, and of a question or an answer, on keys that take more than `SMALL`."""
LOUD = {"observer": 256 * 1024, "operator": 256 * 1024, "manager": MEDIUM, "wizard": 2 * MEDIUM}
"""Bytes a second from which on a router tells that a holder of this role is loud. A manager who asks for 10,000
fragments at once sends some 0.4 MB a second."""
LOUD_ROBOT = 16 * 1024 * 1024
"""The same for all others. A service hands out that much when it is asked for its past."""
MOST_PULSES = 20
"""Pulses of one process that a router passes on in a second. A process of ours sends one or two."""
LONGEST_KEY = 2048
"""Bytes of a key: it may have two ids of 250 characters. Zenoh stops the link of one who sends 65 536 of them."""
LONGEST_ENCODING = 255
"""Bytes of the name of an encoding. More stop the sender's link in Zenoh."""
BESIDE = 8 * 1024
"""Bytes that a message has besides its payload: its attachment, or what a process adds that hands out the past."""


@lru_cache(4096)  # asked for every message
def most(key: str) -> int:
    """Bytes that the payload of a message on this key may have, and of a question or an answer."""
    return next((size for pattern, size in LARGER.items() if keys.matches(pattern, key)), SMALL)


def check_size(key: str, payload: bytes, encoding: str) -> None:
    """Raise InputRefused for what is too large to be sent, or to be read, on this key."""
    if len(payload) > (limit := most(key)):
        advice = "split it into several"
        raise InputRefused(
            Fault(reason=f"{len(payload)} bytes; at most {limit} may be sent", where=key, advice=advice)
        )
    if (length := len(encoding.encode())) > LONGEST_ENCODING:
        reason = f"the name of an encoding has {length} bytes; at most {LONGEST_ENCODING} may be sent"
        raise InputRefused(Fault(reason=reason, where=key, advice="application/msgpack or application/json"))
    if (length := len(key.encode())) > LONGEST_KEY:
        reason = f"a key of {length} bytes; at most {LONGEST_KEY} may be sent"
        raise InputRefused(Fault(reason=reason, where=f"{key[:80]}...", advice="use shorter names and ids"))
