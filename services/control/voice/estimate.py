"""Estimates of speech: the voice can wait at the marks between two words. Pure."""

from collections.abc import Iterable
from itertools import pairwise

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.body import BodyPose, Estimate, Phase, WordTime
from engage_hri.schemas.documents.prosody import unread
from engage_hri.services.control.voice.timeline import Utterance


def speech_estimate(
    behavior: Speech, utterance: Utterance, pose: BodyPose | None, warnings: Iterable[str] = ()
) -> Estimate:
    """Estimate a speech from its time line. pose: the one of the body that speaks, which it leaves as it is.

    warnings: what of it would not be said as it is meant.
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
        behavior=behavior.id, feasible=True, degraded="; ".join(dict.fromkeys([*unread(behavior), *warnings])),
        parts=("voice",), phases=tuple(phases), words=words, pose_after=pose, pose_end=pose,
    )  # fmt: skip
