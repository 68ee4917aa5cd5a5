"""Outlets for sound: what a voice plays goes to a device, into a file, or nowhere, at loop times."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds

STUCK: Seconds = 0.8
"""So long an outlet may take nothing while it is late, before it counts as dead."""


class Outlet:
    """A way for sound; this one leads nowhere, and takes what it is given at once. All times are loop times, seconds.

    now: loop time. lead: how long before a sound is to be heard it has to be played. fault: why nothing is heard any
    more. is_live: true if it may be late: then `late` is to be asked before anything is told as heard.
    """

    def __init__(self, now: Callable[[], Seconds]) -> None:
        self.now = now
        self._fault: Fault | None = None
        self._on_fault: list[Callable[[], None]] = []

    @property
    def is_live(self) -> bool:
        return False

    @property
    def lead(self) -> Seconds:
        return 0.0

    @property
    def fault(self) -> Fault | None:
        return self._fault

    def earliest(self) -> Seconds:
        """The earliest time at which sound that is played now is heard."""
        return self.now()

    def play(self, samples: bytes, at: Seconds) -> None:
        """Play samples so that they sound from `at` on: 16 bit, little-endian, one channel.

        Calls come in the order of time.
        """

    def rest(self) -> None:
        """Take note that silence follows what was played."""

    def late(self) -> Seconds | None:
        """Say by how much all that was played is late: it should have been heard by now, and was not even taken.

        From then on that is the plan, for what is played next, too; so it is to be asked again and again.

        Returns None if nothing is late; 0 if it is as late as when last asked, and nothing was taken since.
        """
        return None

    def cut(self, at: Seconds, tail: bytes) -> None:
        """Take back what was played and would be heard from `at` on. It is called at that time.

        tail: the last samples before it as they should have been, for an outlet that can still change them.
        """

    def revive(self) -> None:
        """Try again after a fault."""

    def watch(self, on_fault: Callable[[], None]) -> Callable[[], None]:
        """Call `on_fault` when there is one, until the returned function is called."""
        self._on_fault.append(on_fault)
        return lambda: self._on_fault.remove(on_fault)

    def tell_fault(self) -> None:
        """Call all that watch."""
        for each in list(self._on_fault):
            each()


class Several(Outlet):
    """Several outlets as one: sound is heard at the same time in each.

    The first is what people hear: all goes by its time, and its fault is that of all. Another one that fails is
    missing, and says so itself.
    """

    def __init__(self, outlets: Sequence[Outlet]) -> None:
        """Join outlets, at least one."""
        super().__init__(outlets[0].now)
        self._outlets = outlets

    @property
    def is_live(self) -> bool:
        return self._outlets[0].is_live

    @property
    def lead(self) -> Seconds:
        return max(each.lead for each in self._outlets)

    @property
    def fault(self) -> Fault | None:
        return self._outlets[0].fault

    def earliest(self) -> Seconds:
        return max(each.earliest() for each in self._outlets)

    def play(self, samples: bytes, at: Seconds) -> None:
        for each in self._outlets:
            each.play(samples, at)

    def rest(self) -> None:
        for each in self._outlets:
            each.rest()

    def late(self) -> Seconds | None:
        return self._outlets[0].late()

    def cut(self, at: Seconds, tail: bytes) -> None:
        for each in self._outlets:
            each.cut(at, tail)

    def revive(self) -> None:
        for each in self._outlets:
            each.revive()

    def watch(self, on_fault: Callable[[], None]) -> Callable[[], None]:
        ends = ExitStack()
        for each in self._outlets:
            ends.callback(each.watch(on_fault))
        return ends.close


class Gag(Outlet):
    """An outlet that can be made to take no sound, as a device that has stopped: the fault `mute`."""

    def __init__(self, outlet: Outlet, now: Callable[[], Seconds]) -> None:
        """Let sound through to an outlet. now: loop time."""
        super().__init__(now)
        self.outlet = outlet
        self._is_mute = False
        self._since: Seconds | None = None
        """Loop time at which it was first asked whether sound is late."""
        self._asked: Seconds = 0.0

    @property
    def is_live(self) -> bool:
        return self._is_mute or self.outlet.is_live

    @property
    def lead(self) -> Seconds:
        return self.outlet.lead

    @property
    def fault(self) -> Fault | None:
        return self._fault or self.outlet.fault

    def switch(self, *, is_mute: bool) -> None:
        """Take no more sound, or take it again. What was played is not heard to its end."""
        if is_mute and not self._is_mute:
            self.outlet.cut(self.now(), b"")
        self._is_mute = is_mute
        self.revive()
        self.tell_fault()

    def revive(self) -> None:
        self._fault = self._since = None
        self.outlet.revive()

    def earliest(self) -> Seconds:
        return self.outlet.earliest()

    def play(self, samples: bytes, at: Seconds) -> None:
        if not self._is_mute:
            self.outlet.play(samples, at)

    def rest(self) -> None:
        if not self._is_mute:
            self.outlet.rest()

    def late(self) -> Seconds | None:
        if not self._is_mute:
            return self.outlet.late()
        now = self.now()
        if self._since is None:
            self._since = self._asked = now
        late, self._asked = now - self._asked, now
        if now - self._since > STUCK:
            self._fault = Fault(reason=f"the device is silent: no sound is taken for {STUCK} s", service="control")
        return late

    def cut(self, at: Seconds, tail: bytes) -> None:
        if not self._is_mute:
            self.outlet.cut(at, tail)

    def watch(self, on_fault: Callable[[], None]) -> Callable[[], None]:
        ends = ExitStack()
        ends.callback(super().watch(on_fault))
        ends.callback(self.outlet.watch(on_fault))
        return ends.close
