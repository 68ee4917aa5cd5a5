"""Bodies that tell what is not so, or do not hear what they are told. See `test_liars.py`."""

import asyncio
from collections.abc import AsyncGenerator, Iterable
from contextlib import aclosing

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Speech
from engage_hri.services.control.contract.body import (
    Arrived,
    MovementAuthority,
    Progress,
    Reached,
    Spoke,
)
from engage_hri.services.control.torso.body import SimulatedBody


class Teller(SimulatedBody):
    """Moves as it should, and tells what `tell` makes of it."""

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        async with aclosing(super().perform(behavior, self.heard(behavior, authority))) as stream:
            async for progress in stream:
                for told in self.tell(behavior, authority, progress):
                    yield told
        for told in self.finish(behavior, authority):
            yield told

    def heard(self, behavior: BlockBehavior, authority: MovementAuthority) -> MovementAuthority:
        return authority

    def tell(self, behavior: BlockBehavior, authority: MovementAuthority, progress: Progress) -> Iterable[Progress]:
        return (progress,)

    def finish(self, behavior: BlockBehavior, authority: MovementAuthority) -> Iterable[Progress]:
        return ()


# -- what is told -------------------------------------------------------------------------------------------------


class Omitting(Teller):
    """Leaves a point out."""

    def tell(self, behavior, authority, progress):
        return () if isinstance(progress, Reached) and progress.sync == "relax" else (progress,)


class Repeating(Teller):
    """Tells a point twice."""

    def tell(self, behavior, authority, progress):
        return (progress, progress) if isinstance(progress, Reached) and progress.sync == "ready" else (progress,)


class Backdating(Teller):
    """Tells times that are 200 ms before the report."""

    def tell(self, behavior, authority, progress):
        return (replace(progress, at=progress.at - 0.2),)


class Hesitating(Teller):
    """Says that it waits where it may pass."""

    def tell(self, behavior, authority, progress):
        is_hold = isinstance(progress, Reached) and progress.sync in ("stroke", "stroke_start")
        return (Arrived(progress.sync, progress.at), progress) if is_hold else (progress,)


class Splitting(Teller):
    """Makes two of an instant."""

    def tell(self, behavior, authority, progress):
        is_split = isinstance(progress, Reached) and progress.sync == "stroke_end"
        return (replace(progress, at=progress.at - 0.01),) if is_split else (progress,)


class Boaster(Teller):
    """Says of what is taken over that it was made."""

    def tell(self, behavior, authority, progress):
        self.told = {} if isinstance(progress, Reached) and progress.sync == "start" else getattr(self, "told", {})
        if isinstance(progress, Reached):
            self.told.setdefault(behavior.id, set()).add(progress.sync)
        return (progress,)

    def finish(self, behavior, authority):
        now = self._loop.time()
        left = [each for each in authority.points if each not in self.told.get(behavior.id, ())]
        return [Reached(sync, now, now) for sync in left if authority.revoked == "taken_over"]


class Early(Teller):
    """Says that it looks as soon as it begins to turn."""

    def tell(self, behavior, authority, progress):
        if isinstance(behavior, Gaze) and isinstance(progress, Reached):
            if progress.sync == "stroke_start":
                return progress, Reached("stroke", progress.at, progress.at)
            if progress.sync == "stroke":
                return ()
        return (progress,)


class Prompter(Teller):
    """Tells all words as it begins."""

    def tell(self, behavior, authority, progress):
        if not isinstance(behavior, Speech) or not isinstance(progress, Reached) or progress.sync != "start":
            return () if isinstance(progress, Spoke) else (progress,)
        ends, position = [], 0
        for word in behavior.text.split():
            position = behavior.text.index(word, position) + len(word)
            ends.append(Spoke(word, position, progress.at))
        return progress, *ends


class Counting(Teller):
    """Counts words where characters are asked for."""

    def tell(self, behavior, authority, progress):
        if isinstance(progress, Spoke):
            count = len(behavior.text[: progress.position].split())
            return (replace(progress, position=count),)
        return (progress,)


class Stammering(Teller):
    """Says a word again after a pause."""

    last: Spoke | None = None

    def tell(self, behavior, authority, progress):
        if not isinstance(progress, Spoke):
            return (progress,)
        again = [self.last] if self.last and progress.at - self.last.at > 3.0 else []
        self.last = progress
        return (*again, progress)


class Forgetful(Teller):
    """Forgets the end of a shift over which a look has come."""

    has_looked = False

    def tell(self, behavior, authority, progress):
        is_end = isinstance(behavior, GazeShift) and isinstance(progress, Reached) and progress.sync == "end"
        self.has_looked = self.has_looked or isinstance(behavior, Gaze)
        return () if is_end and self.has_looked else (progress,)


# -- what is heard ------------------------------------------------------------------------------------------------


class Relay(MovementAuthority):
    """The authority that a body acts on instead of the one that it is given."""

    def __init__(self, behavior: BlockBehavior, given: MovementAuthority) -> None:
        super().__init__(behavior, given.through, given.pace)
        self.given = given
        self.began = asyncio.get_running_loop().time()
        self.is_waiting = False
        given.watch(self.hear)
        self.watch(lambda: self.revoked == "taken_over" and given.revoke("taken_over"))
        self.hear()

    def hear(self) -> None:
        given = self.given
        self.set_pace(given.pace)
        self.hear_through()
        self.hear_hold()
        if given.revoked is not None:
            self.hear_end()

    def hear_through(self) -> None:
        self.extend(self.given.through)

    def hear_hold(self) -> None:
        self.hold() if self.given.held else self.go_on()

    def hear_end(self) -> None:
        self.revoke(self.given.revoked)


class Hearing(Teller):
    """Hears what `Relay` lets through."""

    relay: type[Relay] = Relay

    def heard(self, behavior, authority):
        self.last = self.relay(behavior, authority)
        return self.last

    def tell(self, behavior, authority, progress):
        self.last.is_waiting = isinstance(progress, Arrived)
        return (progress,)


class Deaf(Hearing):
    """Goes on to its end when it is aborted."""

    class relay(Relay):
        def hear_end(self):
            pass


class Stubborn(Hearing):
    """Does not hear an abort while it waits."""

    class relay(Relay):
        def hear_end(self):
            if not self.is_waiting:
                super().hear_end()


class Hasty(Hearing):
    """Asks for no authority."""

    class relay(Relay):
        def hear_through(self):
            self.extend(self.points[-1])


class Restless(Hearing):
    """Cannot be held."""

    class relay(Relay):
        def hear_hold(self):
            pass


class Released(Hearing):
    """Takes a permission for the end of a hold."""

    class relay(Relay):
        def hear_hold(self):
            self.hold() if self.given.held and self.given.through != "end" else self.go_on()


class Presuming(Hearing):
    """Takes the end of a hold for a permission."""

    class relay(Relay):
        was_held = False

        def hear_through(self):
            super().hear_through()
            if self.was_held and not self.given.held:
                self.extend(self.points[-1])
            self.was_held = self.given.held


class Pacing(Hearing):
    """Takes a pace for the end of a hold."""

    class relay(Relay):
        def hear_hold(self):
            self.hold() if self.given.held and not self.given.pace else self.go_on()


class Inattentive(Hearing):
    """Cannot be held once it has moved for a while."""

    class relay(Relay):
        def hear_hold(self):
            if asyncio.get_running_loop().time() < self.began + 0.1:
                super().hear_hold()


class Possessed(Hearing):
    """Does not hear how it ends while it is held."""

    class relay(Relay):
        def hear_end(self):
            if not self.given.held:
                super().hear_end()
