"""The keys on which this process publishes, as declared to Zenoh: those used last, for keys come and go."""

import zenoh

from engage_hri.services.bus.zenoh.session import QOS, STREAM_QOS

MOST = 256
"""Number of keys that are declared at a time: people and clients come and go, each with keys of its own."""


class Publishers:
    """Publishers of a session, by key, declared as they are needed."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._declared: dict[str, zenoh.Publisher] = {}

    def of(self, key: str, ordered: bool) -> zenoh.Publisher:
        """Return the publisher of a key. ordered: False for a stream."""
        publisher = self._declared.get(key)
        if publisher is None:
            if len(self._declared) >= MOST:
                self.drop(next(iter(self._declared)))
            qos = QOS if ordered else STREAM_QOS
            publisher = self._session.declare_publisher(key, allowed_destination=zenoh.Locality.REMOTE, **qos)
            self._declared[key] = publisher
        return publisher

    def drop(self, key: str) -> None:
        """Take back the declaration of a key, if there is one."""
        if (publisher := self._declared.pop(key, None)) is not None:
            publisher.undeclare()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        for key in tuple(self._declared):
            self.drop(key)
