"""Judges what recognition tells of the looks of a film against what is true of them."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from engage_hri.schemas.perception import ActionBegan, ActionEnded, HeadPose
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.gaze_targets import SURFACE
from engage_hri.services.recognition.recognizer import Recognizer
from tests.perception.eyes.film_of_looks import BESIDE, PIECES, RATE, SURE, FilmedLook, world
from tests.recognition.observations import ROBOT

WHO = "face_1"


class ToldLook(NamedTuple):
    """A look as it was told."""

    named: tuple[str, ...]
    one_of: bool
    since: Seconds
    until: Seconds


class JudgedLooks(NamedTuple):
    """Counts of a film. times: instants that are judged, one a picture. kinds: those with the right kind of target.

    pieces: looks at pieces. among: those with the piece among what is named. sure: looks of which one piece is named
    alone; sure_right: it is that one. all_looks, onsets: all, and those that began within 0.25 s.
    """

    times: int = 0
    kinds: int = 0
    pieces: int = 0
    sure: int = 0
    sure_right: int = 0
    among: int = 0
    all_looks: int = 0
    onsets: int = 0

    def __add__(self, other: object) -> "JudgedLooks":
        assert isinstance(other, JudgedLooks)
        return JudgedLooks(*(a + b for a, b in zip(self, other, strict=True)))


def told_looks(poses: Iterable[HeadPose], looks: Sequence[FilmedLook], *, learns: bool) -> list[ToldLook]:
    """What recognition tells of one person's looks. learns: the first looks are known: the robot looks at who is to
    look at it, and fingers are seen."""
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    told: list[ToldLook] = []
    open_: list[ActionBegan] = []
    news: list[tuple[Seconds, ActionBegan | ActionEnded]] = []
    for look in looks[:SURE] if learns else ():
        actor, action = (ROBOT, "look") if look.target == ROBOT else (WHO, "point")
        targets = (WHO,) if look.target == ROBOT else (look.target,)
        for kind, at in ((ActionBegan, look.since), (ActionEnded, look.until - 0.05)):
            news.append((at, kind(actor=actor, action=action, targets=targets, at=Stamp("loop", at))))  # type: ignore[arg-type]

    def take(results: Iterable[object]) -> None:
        for each in results:
            if isinstance(each, ActionBegan) and (each.actor, each.action) == (WHO, "look"):
                open_.append(each)
            elif isinstance(each, ActionEnded) and (each.actor, each.action) == (WHO, "look"):
                began = open_.pop()
                told.append(ToldLook(began.targets, began.one_of, began.at.seconds, each.at.seconds))

    recognizer.feed(world(), 0.0, 0.0)
    for pose in poses:
        now = pose.at.seconds
        while news and news[0][0] <= now:
            at, action_ = news.pop(0)
            take(recognizer.feed(action_, at, now))
        while (due := recognizer.deadline) is not None and due <= now:
            take(recognizer.advance(due))
        take(recognizer.feed(pose, now, now))
    told += [ToldLook(each.targets, each.one_of, each.at.seconds, float("inf")) for each in open_]
    return told


def kind(named: Sequence[str]) -> str:
    """Kind of what is looked at: `robot`, `table` with all that lies on it, or ``: elsewhere."""
    if any(name in (*PIECES, SURFACE) for name in named):
        return SURFACE
    return ROBOT if ROBOT in named and BESIDE not in named else ""


def judged(told: Sequence[ToldLook], looks: Sequence[FilmedLook]) -> JudgedLooks:
    """Judge what was told of all looks but the first, which may have been known."""
    sums = JudgedLooks()
    for look in looks[SURE:]:
        during = [each for each in told if each.since < look.until - 0.1 and each.until > look.since + 0.1]
        instants = [k / RATE for k in range(int(look.since * RATE) + 1, int(look.until * RATE) + 1)]
        right = sum(kind(_at(told, at)) == kind((look.target,)) for at in instants)
        begun = [each.since for each in during if kind(each.named) == kind((look.target,))]
        is_piece, last = (
            look.target in PIECES,
            max(during, key=lambda one: min(one.until, look.until) - max(one.since, look.since), default=None),
        )
        is_sure = last is not None and not last.one_of and last.named[:1] and last.named[0] in PIECES
        sums += JudgedLooks(
            times=len(instants), kinds=right, pieces=is_piece, sure=bool(is_sure),
            sure_right=bool(is_sure and last is not None and last.named == (look.target,)),
            among=bool(is_piece and last is not None and look.target in last.named),
            all_looks=1, onsets=bool(begun and min(begun) <= look.since + 0.25),
        )  # fmt: skip
    return sums


def _at(told: Sequence[ToldLook], at: Seconds) -> tuple[str, ...]:
    return next((each.named for each in told if each.since <= at < each.until), ())
