"""Voices of bodies, bodies of one part that speak, and estimates of what they say."""

from abc import ABC, abstractmethod
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from itertools import pairwise
from math import inf

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, Phase, WordTime
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.documents.prosody import unread
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.references import type_name
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    Bell,
    Body,
    BodyFailed,
    BodyState,
    MovementAuthority,
    Progress,
    Reached,
)
from engage_hri.services.control.contract.refusals import infeasible, unsupported
from engage_hri.services.control.voice.synthesis import SynthesisFailed
from engage_hri.services.control.voice.timeline import Utterance


class Voice:
    """Voice of a body: it says one text at a time, and refuses another one meanwhile.

    is_mute: it makes no sound, and reports its words all the same; may be changed while it speaks.
    """

    def __init__(self, *, is_mute: bool = False) -> None:
        self.is_mute = is_mute
        self._text = ""
        self._utterance: MovementAuthority | None = None
        self._waiting: list[Bell] = []

    @property
    def saying(self) -> str:
        """The text that is being said; empty: silence."""
        return "" if self.is_mute else self._text

    @property
    def is_busy(self) -> bool:
        return self._utterance is not None

    def hush(self) -> None:
        """End what is being said, at a word."""
        if self._utterance is not None:
            self._utterance.revoke()

    async def wait_for_silence(self, authority: MovementAuthority) -> None:
        """Wait until an aborted speech has finished its current word; return at once if `authority` is revoked."""
        bell = Bell()
        unwatch = authority.watch(bell.ring)
        self._waiting.append(bell)
        try:
            while self._utterance is not None and self._utterance.revoked is not None and authority.revoked is None:
                await bell.wait(inf)
        finally:
            self._waiting.remove(bell)
            unwatch()

    async def say(
        self, behavior: Speech, authority: MovementAuthority, words: AsyncGenerator[Progress, None]
    ) -> AsyncGenerator[Progress, None]:
        """Say a text. words: what is told of it as it is said. Raises BehaviorRefused: it says another."""
        if self._utterance is not None:
            reason = f"the voice is busy with {self._text!r}"
            raise BehaviorRefused(Fault(reason=reason, where=behavior.id, service="control"))
        self._utterance, self._text = authority, behavior.text
        try:
            async with aclosing(words) as utterance:
                async for progress in utterance:
                    if isinstance(progress, Reached) and progress.sync == "end":
                        self._utterance, self._text = None, ""
                    yield progress
        finally:
            if self._utterance is authority:
                self._utterance, self._text = None, ""
            for bell in self._waiting:
                bell.ring()


def speech_estimate(behavior: Speech, utterance: Utterance, pose: BodyPose | None) -> Estimate:
    """Estimate a speech from its time line: the voice can wait at the marks between two words.

    pose: the one of the body that speaks, which it leaves as it is.
    """
    times = {"start": 0.0, **{mark.id: utterance.said_by(mark.position) for mark in behavior.marks}}
    times["end"] = utterance.seconds
    gaps = {mark.id for mark in behavior.marks if utterance.is_gap(mark.position)}
    phases = []
    for since, to in pairwise(sync_points(behavior)):
        seconds = times[to] - times[since]
        longest = None if to in gaps or not seconds else seconds
        phases.append(Phase(since=since, to=to, shortest=seconds, natural=seconds, longest=longest, hold=to in gaps))
    words = tuple([WordTime(position=word.position, start=word.start, end=word.end) for word in utterance.words])
    return Estimate(
        behavior=behavior.id, feasible=True, degraded="; ".join(unread(behavior)),
        parts=("voice",), phases=tuple(phases), words=words, pose_after=pose, pose_end=pose,
    )  # fmt: skip


FAULTS = ("mute", "voiceless")
"""Kinds of faults that it can play."""


class Speaker(Body, ABC):
    """A body with the one part `voice`. A subclass says how long a speech takes, and says it."""

    def __init__(self, name: str) -> None:
        self.capabilities = Capabilities(body=name, types=("speech",), parts=("voice",), faults=FAULTS)
        self._voice = Voice()
        self._faults: tuple[BodyFault, ...] = ()

    @abstractmethod
    def timed(self, behavior: Speech) -> Utterance:
        """Lay a speech out in time. Raises SynthesisFailed: it cannot be said."""

    @abstractmethod
    async def said(self, behavior: Speech, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        """Get ready for a speech, and return what is told of it as it is said. Raises BehaviorRefused."""

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        if not isinstance(behavior, Speech):
            return unsupported(behavior)
        try:
            if self._is_voiceless:
                raise SynthesisFailed(voiceless(behavior))
            return speech_estimate(behavior, self.timed(behavior), pose or BodyPose())
        except SynthesisFailed as error:
            fault = replace(error.fault, where=behavior.id)
            return infeasible(behavior.id, "CANNOT_CREATE_BEHAVIOR", fault)

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        if not isinstance(behavior, Speech):
            reason = f"this voice has no {type_name(behavior)}"
            raise BehaviorRefused(Fault(reason=reason, where=behavior.id, service="control"))
        if self._is_voiceless:
            raise BehaviorRefused(voiceless(behavior))
        await self._voice.wait_for_silence(authority)
        if authority.revoked is not None:
            return
        words = await self.said(behavior, authority)
        async with aclosing(self._voice.say(behavior, authority, words)) as utterance:
            async for progress in utterance:
                yield progress
                if isinstance(progress, Reached) and progress.sync == "end":
                    return
        if self._is_voiceless:
            raise BodyFailed(voiceless(behavior))

    @property
    def faults(self) -> tuple[BodyFault, ...]:
        return self._faults

    def switch_faults(self, faults: Sequence[BodyFault]) -> None:
        for fault in faults:
            if fault.kind not in FAULTS:
                reason = f"this voice cannot play {fault.kind!r}; it can play {', '.join(FAULTS)}"
                raise InputRefused(Fault(reason=reason, where=fault.kind, service="control"))
        self._faults = tuple(faults)
        self._voice.is_mute = any(fault.kind == "mute" for fault in faults)
        if self._is_voiceless:
            self._voice.hush()

    @property
    def _is_voiceless(self) -> bool:
        return any(fault.kind == "voiceless" for fault in self._faults)

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        if not parts or "voice" in parts:
            self._voice.hush()

    def state(self) -> BodyState:
        return BodyState(pose=BodyPose(), moving=self._voice.is_busy, speaking=self._voice.saying)

    def see(self, world: World) -> None:
        """Look at nothing: it only speaks."""


def voiceless(behavior: BlockBehavior) -> Fault:
    """Say why a voice that knows that it is mute does not speak."""
    return Fault(reason="the voice cannot speak", where=behavior.id, service="control")
