"""A person with the statistics of Table 2.1 of the thesis: habits and mistakes by chance, and is sometimes busy.

Pure; chance comes from outside. The person knows only what can be heard and seen of the robot: its words, looks and
points, as realised. Requests must be in the words of the tangram's; known are the pieces by color and shape, the
eight directions, and that "this" is the piece at which the robot points.

`Habits` has the numbers, each with its source. They are values of a class and no settings: a study compares robots
that meet the same person. A study of other people gives `simulate` other habits.
"""

import re
from collections.abc import Callable
from heapq import heappop, heappush
from itertools import count

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.tables import SIDES, poses_touching
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.simulation.chance import Chance, Delays
from engage_hri.services.simulation.company import COMES, GOES, moves
from engage_hri.services.simulation.human import (
    FACE,
    TABLE,
    THINKING,
    Act,
    HeardSpeech,
    Hearing,
    Human,
    Lay,
    Leave,
    LookAt,
    Pause,
    Sit,
    Start,
    Stop,
    Withdraw,
    speech,
)
from engage_hri.services.tangram.table import TangramTable

# -- habits -------------------------------------------------------------------------------------------------------


class Habits(Struct, frozen=True, kw_only=True):
    """Habits of the stochastic person ("they" below). Delays are least, mean and longest, in seconds."""

    follows_point: Probability = 0.929
    """Share of the robot's points that they follow with a look. Table 2.1, directed gaze."""
    follows_look: Probability = 0.8
    """The same for looks without a point. Ours: the table does not separate gaze with and without pointing."""
    follow_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.3, 2.0)
    """Delay from the robot's look or point to theirs. Table 2.1."""
    answers_look: Probability = 0.458
    """Share of the robot's looks at their face that they answer, times `propensity`. Table 2.1: facial gaze."""
    look_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.7, 1.5)
    """Delay from the robot's look to theirs. Table 2.1."""
    answers_turn: Probability = 0.682
    """Share of the turns that they answer, or begin to carry out, in time. Table 2.1, adjacency pair. If they do
    not, and the turn was a request, they study the pieces first."""
    answer_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.4, 1.1)
    """Delay from the end of the turn to the answer. Table 2.1."""
    study: tuple[Seconds, Seconds, Seconds] = (4.0, 9.0, 60.0)
    """Time for which they study the pieces: the busy regime. Thesis 2.3 has it; the numbers are ours."""
    hesitates: tuple[Seconds, Seconds, Seconds] = (0.3, 2.0, 6.0)
    """Time for which they look at the piece before they reach for it. Ours, with the two that follow: sessions of the
    thesis' participants take 345 s, with a standard deviation of 96 s, and of those of Table 2.1 somebody gives a
    first turn each 12 s."""
    fits: tuple[Seconds, Seconds, Seconds] = (1.0, 12.0, 36.0)
    """Time for which they turn it to and fro where it is to lie, until it fits. Ours."""
    pace: tuple[Seconds, Seconds, Seconds] = (0.4, 1.0, 3.0)
    """Factor on these two times and on those of study and search, drawn once for each person. Ours."""
    busy_answers: Probability = 0.25
    """Factor on these three shares, and on what they do unasked, while they study or move pieces. Ours."""
    search: tuple[Seconds, Seconds, Seconds] = (0.3, 1.5, 6.0)
    """Time for which they search for a piece without having seen the robot point or look at it. Ours."""
    hears: Probability = 0.97
    """Share of the robot's utterances that they hear. Ours."""
    guesses: Probability = 0.5
    """Probability of a guess which piece "this" or "that" is, if they have not seen it shown; else they ask. Ours."""
    confuses: Probability = 0.06
    """Share of the pieces, not seen shown, that they confuse with one of the same color or shape. Ours."""
    confuses_shown: Probability = 0.01
    """The same for pieces that they have seen the robot show. Ours."""
    misplaces: Probability = 0.05
    """Share of the pieces that they lay on another side of the landmark than asked. Ours."""
    backchannels: Probability = 0.03
    """Share of the robot's words after which they nod, or say a brief word. Ours."""
    speaks: Probability = 0.3
    """Share of backchannels and answers that are words; the others are nods. Ours."""
    looks_up_every: Seconds = 40.0
    """Mean time between unasked looks at the robot's face, at a `propensity` of 1. Ours."""
    directs_every: Seconds = 90.0
    """Mean time between unasked looks or points at a piece, while the robot is silent. Ours."""
    points: Probability = 0.4
    """Share of these looks and points that are points. Ours."""
    glance: Seconds = 1.2
    """Length of a look at a face or a thing. Ours."""
    reports: Probability = 0.7
    """Share of the laid pieces after which they look at the robot's face, times `propensity`. Ours."""


# -- the robot's requests -----------------------------------------------------------------------------------------


REQUEST = re.compile(
    r"(?:move|fix|put) (?P<piece>.+?) so that it is touching the (?P<side>[a-z ]+?) of (?P<landmark>.+)"
)
POINTED = ("this", "that")


def is_request(utterance: HeardSpeech) -> bool:
    """Tell whether the robot asks for a piece to be laid somewhere."""
    return REQUEST.search(utterance.words) is not None


def requested_placement(utterance: HeardSpeech, table: TangramTable) -> Lay | None:
    """The placement for which the robot asks; None if it asks for none, or if words and pointing leave it open."""
    request = REQUEST.search(utterance.words)
    if request is None:
        return None
    piece = utterance.pointed if request["piece"] in POINTED else _piece_called(request["piece"], table)
    landmark = _piece_called(request["landmark"], table)
    side = next((side for side in SIDES if side == request["side"].removesuffix(" side")), None)
    return Lay(piece, side, landmark) if piece and landmark and side else None


def _piece_called(phrase: str, table: TangramTable) -> str:
    """Id of the only piece with the color and shape of the phrase; empty if none or several have them."""
    words = set(phrase.split()) - {"the", "a", "piece"}
    meant = [piece.id for piece in table.pieces if words <= {piece.color, piece.shape}]
    return meant[0] if words and len(meant) == 1 else ""


# -- the person ---------------------------------------------------------------------------------------------------


NOD: Seconds = 0.5
WORD: Seconds = 0.5
"""Length of a spoken backchannel or answer: shorter than 0.8 s, from which on speech is a change of floor."""
QUESTION: Seconds = 1.0
"""Length of the question "Which one?"."""
GLANCE_UP: Seconds = 0.2
"""Delay from laying a piece down to looking up."""


class _Thought(Struct, order=True):
    """A decision to make at `at`."""

    at: Seconds
    number: int
    decide: Callable[[Seconds], None]


class StochasticHuman(Human):
    """The stochastic person: does what the robot asks for, at a varying pace and with some mistakes."""

    def __init__(
        self, table: TangramTable, habits: Habits, reciprocity: Probability, chance: Chance, robot: str = "robot"
    ) -> None:
        super().__init__((), robot)
        self._table = table
        self._habits = habits
        self._reciprocity = reciprocity
        self._chance = chance
        self._pieces = frozenset(piece.id for piece in table.pieces)
        self._hearing = Hearing(robot)
        self._thoughts: list[_Thought] = []
        self._thought_numbers = count()
        self._seated = False
        self._gaze = ""
        self._looks = 0
        """Number of looks so far: a plan made at another number is outdated."""
        self._robot_gaze = ""
        self._robot_speech: set[str] = set()
        """Ids of the robot's present speech behaviors."""
        self._shown: set[str] = set()
        """Pieces that the person saw the robot look or point at during its present turn."""
        self._task: Lay | None = None
        """Present or next task: with one the person is in the busy regime."""
        self._next_task: Lay | None = None
        """Task that the robot asked for meanwhile."""
        self._gesture_until: Seconds = 0.0
        self._awaits_eyes = False
        """True while the person looks at the robot's face and it has not looked back yet."""
        self._pace = self._drawn(habits.pace)
        """The higher the slower."""
        self.propensity = 1.0
        """Propensity for looks at the robot's face, 0..2."""

    # -- time ---------------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        times = [super().deadline, self._thoughts[0].at if self._thoughts else None]
        return min((time for time in times if time is not None), default=None)

    def due(self, now: Seconds) -> tuple[Act, ...]:
        while self._thoughts and self._thoughts[0].at <= now:
            heappop(self._thoughts).decide(now)
        acts = super().due(now)
        if acts:
            self._update(acts[0], now)
        return acts

    def _later(self, at: Seconds, decide: Callable[[Seconds], None]) -> None:
        heappush(self._thoughts, _Thought(at, next(self._thought_numbers), decide))

    def _update(self, act: Act, now: Seconds) -> None:
        """Update the person's state for an act that is done now."""
        match act:
            case LookAt(target=target):
                self._look_changes(target)
            case Sit():
                self._seated = True
                self._plan_look_up(now)
                self._plan_direction(now)
            case Leave():
                self._seated = False
                self._thoughts.clear()
                self._due.clear()
            case Withdraw():
                self._finish(now)

    # -- perception ----------------------------------------------------------------------------------------------

    def enter(self, now: Seconds) -> None:
        self.schedule((*COMES, Pause(self._habits.glance), LookAt(TABLE)), now)

    def feed(self, message: Message, now: Seconds) -> None:
        if not self._seated:
            return
        match message:
            case ActionBegan(actor=self._robot, action="look", targets=targets):
                self._robot_gaze = targets[0] if targets else ""
                if self._robot_gaze == self._table.person.id:
                    self._robot_looks_at_them(now)
                elif self._robot_gaze in self._pieces:
                    self._follow(self._robot_gaze, self._habits.follows_look, now)
            case ActionEnded(actor=self._robot, action="look", targets=(self._robot_gaze,)):
                self._robot_gaze = ""
            case ActionBegan(actor=self._robot, action="speak", behavior=behavior):
                self._robot_speech.add(behavior)
            case ActionEnded(actor=self._robot, action="speak", behavior=behavior):
                self._robot_speech.discard(behavior)
            case ActionBegan(actor=self._robot, action="point", targets=(target,)) if target in self._pieces:
                self._follow(target, self._habits.follows_point, now)
            case WordSpoken() if self._happens(self._habits.backchannels) and not self._task:
                self._utter(now + 0.2)
        utterance = self._hearing.feed(message)
        if utterance is not None:
            self._respond(utterance, now)
            self._shown.clear()

    def _happens(self, probability: Probability) -> bool:
        return self._chance.random() < probability

    def _answers(self, probability: Probability) -> bool:
        return self._happens(probability * (self._habits.busy_answers if self._task else 1.0))

    def _drawn(self, delays: tuple[Seconds, Seconds, Seconds]) -> Seconds:
        return Delays(*delays).draw(self._chance)

    # -- gaze ---------------------------------------------------------------------------------------------------

    def _glances(self, target: str, at: Seconds) -> None:
        """Plan to look at the target, and after a while back at the table, unless the next look has come before."""
        self._later(at, lambda now: self._glance(target, now))

    def _glance(self, target: str, now: Seconds) -> None:
        if self._gaze != target:
            self.schedule((LookAt(target),), now)
            self._look_back(self._looks + 1, now)

    def _look_back(self, look: int, now: Seconds) -> None:
        def back(now: Seconds) -> None:
            if self._looks == look:
                self.schedule((LookAt(TABLE),), now)

        self._later(now + self._habits.glance, back)

    def _follow(self, piece: str, follows: Probability, now: Seconds) -> None:
        """Look, perhaps, at a piece that the robot shows by look or point; a shown one is not looked at again."""
        if piece not in self._shown and self._answers(follows):
            self._shown.add(piece)
            self._glances(piece, now + self._drawn(self._habits.follow_delay))

    # -- eye contact --------------------------------------------------------------------------------------------

    def _robot_looks_at_them(self, now: Seconds) -> None:
        if self._gaze == FACE:
            self._meet_eyes()
        elif self._answers(min(1.0, self._habits.answers_look * self.propensity)):
            self._glances(FACE, now + self._drawn(self._habits.look_delay))

    def _look_changes(self, target: str) -> None:
        """Note a look of the person, and learn from the one before whether the robot looked back."""
        if self._awaits_eyes:
            self._learn(answered=False)
        self._gaze = target
        self._looks += 1
        self._awaits_eyes = target == FACE
        if self._robot_gaze == self._table.person.id:
            self._meet_eyes()

    def _meet_eyes(self) -> None:
        if self._awaits_eyes:
            self._learn(answered=True)

    def _learn(self, *, answered: bool) -> None:
        self._awaits_eyes = False
        self.propensity += self._reciprocity * ((2.0 if answered else 0.0) - self.propensity)

    # -- unasked acts --------------------------------------------------------------------------------------------

    def _plan_look_up(self, now: Seconds) -> None:
        """Plan the next unasked look at the robot's face: the less the robot looks back, the fewer there are."""

        def look_up(now: Seconds) -> None:
            if self._answers(self.propensity / 2):
                self._glance(FACE, now)
            self._plan_look_up(now)

        # Twice as often as at a propensity of 1, which half of the times come to nothing.
        self._later(now + self._chance.expovariate(2 / self._habits.looks_up_every), look_up)

    def _plan_direction(self, now: Seconds) -> None:
        """Plan the next unasked look or point at some piece; there is none while the robot speaks."""

        def direct(now: Seconds) -> None:
            if not self._robot_speech and self._answers(1.0):
                piece = self._chance.choice(sorted(self._pieces))
                self._glance(piece, now)
                if self._happens(self._habits.points):
                    self._gestures("point", self._habits.glance, now, piece)
            self._plan_direction(now)

        self._later(now + self._chance.expovariate(1 / self._habits.directs_every), direct)

    # -- turns --------------------------------------------------------------------------------------------------

    def _respond(self, utterance: HeardSpeech, now: Seconds) -> None:
        """Answer an utterance of the robot."""
        habits = self._habits
        if utterance.words == THINKING or not self._happens(habits.hears):
            return
        at = now + self._drawn(habits.answer_delay)
        if "goodbye" in utterance.words:
            self.schedule(GOES, at)
        elif is_request(utterance):
            self._take_up(self._understood(utterance), at)
        elif self._answers(habits.answers_turn):
            self._utter(at)

    def _understood(self, utterance: HeardSpeech) -> Lay | None:
        """Task as the person understands it, which may be wrong; None if that is left open."""
        habits = self._habits
        if utterance.pointed not in self._shown:
            guess = self._chance.choice(sorted(self._pieces)) if self._happens(habits.guesses) else ""
            utterance = HeardSpeech(utterance.words, guess)
        asked = requested_placement(utterance, self._table)
        if asked is None:
            return None
        if self._happens(habits.confuses_shown if asked.piece in self._shown else habits.confuses):
            return self._one_of(self._other_pieces(asked), asked)
        if self._happens(habits.misplaces):
            return self._one_of(self._other_sides(asked), asked)
        return asked

    def _one_of(self, mistakes: list[Lay], asked: Lay) -> Lay:
        return self._chance.choice(mistakes) if mistakes else asked

    def _other_pieces(self, asked: Lay) -> list[Lay]:
        """The same task with another piece of the same color or shape, where that fits."""
        right = self._table.piece(asked.piece)
        others = (
            Lay(piece.id, asked.side, asked.landmark)
            for piece in self._table.pieces
            if piece is not right and (piece.color == right.color or piece.shape == right.shape)
        )
        return [lay for lay in others if lay.piece != asked.landmark and self._fits(lay)]

    def _other_sides(self, asked: Lay) -> list[Lay]:
        """The same task on another side of the landmark, where that fits."""
        others = (Lay(asked.piece, side, asked.landmark) for side in SIDES if side != asked.side)
        return [lay for lay in others if self._fits(lay)]

    def _fits(self, lay: Lay) -> bool:
        """True if the landmark, as it lies in the figure, has a fitting edge on that side."""
        piece, landmark = self._table.piece(lay.piece), self._table.piece(lay.landmark)
        there = self._table.lying(landmark, landmark.goal)
        return any(True for _ in poses_touching(self._table.lying(piece, piece.start), there, lay.side))

    def _take_up(self, task: Lay | None, at: Seconds) -> None:
        """Begin the task after finding the piece, and perhaps after studying all pieces. None: ask which is meant."""
        if task is None:
            self._glances(FACE, at)
            self._says("Which one?", QUESTION, at)
            return
        if task == self._task:
            return
        if task.piece not in self._shown:
            at += self._pace * self._drawn(self._habits.search)
        if not self._happens(self._habits.answers_turn):
            at += self._pace * self._drawn(self._habits.study)
        if self._task is None:
            self._begin(task, at)
        else:
            self._next_task = task

    def _begin(self, task: Lay, at: Seconds) -> None:
        self._task = task
        hesitates, fits = (self._pace * self._drawn(each) for each in (self._habits.hesitates, self._habits.fits))
        self.schedule(moves(replace(task, fits=fits), hesitates), at)

    def _finish(self, now: Seconds) -> None:
        """End the task, now that the piece lies there: begin the next one, or look up."""
        self._task, following = None, self._next_task
        self._next_task = None
        if following is not None:
            self._begin(following, now)
            return
        self.schedule((LookAt(TABLE),), now)
        if self._answers(min(1.0, self._habits.reports * self.propensity)):
            self._glances(FACE, now + GLANCE_UP)

    # -- voice and gestures -------------------------------------------------------------------------------------

    def _utter(self, at: Seconds) -> None:
        """Say a brief word or nod: an answer, or a backchannel while the robot speaks."""
        if self._happens(self._habits.speaks):
            self._says("Uh-huh." if self._robot_speech else "Okay.", WORD, at)
        else:
            self._gestures("nod", NOD, at)

    def _says(self, words: str, seconds: Seconds, at: Seconds) -> None:
        """Speak, unless another gesture is still going on."""
        if at >= self._gesture_until:
            self._gesture_until = at + seconds
            self.schedule(speech(words, seconds), at)

    def _gestures(self, action: Action, seconds: Seconds, at: Seconds, target: str = "") -> None:
        """Nod or point, unless another gesture is still going on."""
        if at >= self._gesture_until:
            self._gesture_until = at + seconds
            self.schedule((Start(action, target), Pause(seconds), Stop(action, target)), at)
