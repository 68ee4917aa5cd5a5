"""Appendix B of the thesis as observations: the events of each fragment, at both gaze resolutions.

Times are plausible ones of our own; who looks where between which words is the transcript's.
"""

from collections import Counter

import pytest

from tests.recognition.observations import HUMAN, ROBOT, Log

TABLE = "table"
RESOLUTIONS = ("table", "object")


class Interaction(Log):
    """The transcript's robot: fragments begin with an adjacency pair and end with an optional mutual gaze."""

    def __init__(self, resolution: str) -> None:
        super().__init__(gaze_resolution=resolution)
        self.step = 0
        self.start = 0.0

    @property
    def block(self) -> str:
        return f"fragment-{self.step}"

    def tell(self, step: int, start: float, story: str) -> None:
        """Steps like `1.9 human rectangle`, from the start of the fragment on. What they mean: `_take`."""
        self.step, self.start = step, start
        self.owner("fragment", HUMAN, start)
        for told in story.replace("\n", ";").split(";"):
            if words := told.split():
                self._take(float(words[0]), *words[1:])

    def _take(self, at: float, what: str, *words: str) -> None:
        match what:
            case "human" | "robot":
                self.looks(what, words[0].replace("face", ROBOT), self.start + at)
            case "says" | "silent":
                speech = f"{self.block}:speech"
                (self.begins if what == "says" else self.ends)(ROBOT, "speak", self.start + at, behavior=speech)
            case "acts" | "acted":
                (self.begins if what == "acts" else self.ends)(HUMAN, "act", self.start + at, words[0])
            case "head":
                self.owner("fragment", words[0], self.start + at)
            case "asks":
                self.asks(at, *words)
            case "directs":
                phrase = float(words[1])
                self.directs(at, words[0], phrase, phrase if "pointing" in words else None)
            case "over":
                self.turn_over(at)
            case "done":
                self.done(at)
            case "time":
                self.until(self.start + at)
            case _:
                raise ValueError(what)

    def asks(self, at: float, *accept: str) -> None:
        self.requests_event(
            "adjacency_pair", self.start + at, id=f"ap-{self.step}", block=self.block, turn=self.block, accept=accept
        )

    def directs(self, at: float, target: str, phrase: float, point: float | None = None) -> None:
        """Gaze at `at` (on target 0.3 s later), perhaps a point, the phrase: the event's anchors."""
        name = f"{target}-{at}"
        anchors = [f"{name}-gaze:stroke", f"{name}-phrase:start"] + ([f"{name}-point:stroke_start"] if point else [])
        self.requests_event(
            "directed_gaze", self.start + at, target, id=name, block=self.block, cause="reference",
            anchors=tuple(anchors),
        )  # fmt: skip
        self.looks(ROBOT, target, self.start + at + 0.3)
        self.passes(f"{name}-gaze:stroke", self.start + at + 0.3, self.block)
        if point:
            self.passes(f"{name}-point:stroke_start", self.start + point, self.block)
        self.passes(f"{name}-phrase:start", self.start + phrase, self.block)

    def turn_over(self, at: float) -> None:
        """The last word: the turn ends and the robot seeks the person's eyes."""
        self.signals("ended", self.start + at, turn=self.block, block=self.block)
        self.owner("fragment", HUMAN, self.start + at)
        self.requests_event(
            "mutual_facial_gaze", self.start + at, id=f"mfg-{self.step}", block=self.block, turn=self.block,
            optional=True,
        )  # fmt: skip

    def done(self, at: float) -> None:
        self.block_ends(self.start + at, block=self.block)
        self.owner("face", HUMAN, self.start + at)

    def of(self, step: int) -> list[tuple[str, tuple[str, ...], str]]:
        """(kind, objects, decision) of the robot's events in this step, by start."""
        ids = [event.id for event in self.events if event.block == f"fragment-{step}" and event.state == "started"]
        lives = [(self.last(id), self.states(id)) for id in ids]
        lives.sort(key=lambda life: life[0].started.seconds)
        return [(SHORT[last.kind], last.objects, states[1][0].upper()) for last, states in lives if len(states) > 1]


SHORT = {"directed_gaze": "DG", "mutual_facial_gaze": "MFG", "adjacency_pair": "AP", "backchannel": "BC"}


STEP_5_AND_6 = """
    0 robot human; 0.2 human face; 0.4 asks act; 0.4 says; 1 silent; 1 head blue-square
    1 directs blue-square 1.9 pointing; 1.9 says; 2.3 human blue-square; 2.5 silent
    2.6 says; 2.9 robot human; 3.4 human rectangle; 4.6 silent; 4.6 head rectangle
    4.6 directs rectangle 4.6; 4.6 says; 5.3 silent; 5.3 over; 5.6 robot human; 5.6 done; 8 time
    9 acts blue-square; 10 robot human-hand; 11.5 acted blue-square; 12 human face; 12.4 robot human
"""
STEP_18_AND_19 = """
    0 human face; 0.1 robot human; 0.4 asks act; 0.4 says; 1 silent; 1 head purple-triangle
    1 directs purple-triangle 1.9 pointing; 1.9 says; 2.2 silent; 4.4 time
    4.5 says; 4.6 robot human; 6.8 human table; 7 silent; 7 head pink-square
    7 directs pink-square 7; 7 says; 7.8 silent; 7.9 human purple-triangle; 7.9 over; 8.2 robot human; 8.2 done
    11 time; 12 acts purple-triangle; 14 acted purple-triangle
"""
STEP_21 = """
    0 human table; 0.1 robot human; 0.4 asks act; 0.4 says; 0.6 human face; 1 silent; 1 head green-square
    1 directs green-square 1.9 pointing; 1.9 human green-square; 1.9 says; 2.2 silent
    2.3 says; 2.5 robot human; 2.7 human face; 4.2 human table; 4.4 silent; 4.4 head blue-square
    4.4 directs blue-square 4.4; 4.4 says; 4.9 human face; 5.1 human table; 5.2 silent; 5.2 over; 5.5 robot human
    5.5 done; 7.9 time; 9 acts green-square; 11 acted green-square
"""


def step_5_and_6(log: Interaction) -> None:
    """ "Please move the blue piece so that it is touching the top of the rectangle", and the person does."""
    log.looks(HUMAN, TABLE, 0.0)
    log.tell(5, 10.0, STEP_5_AND_6)


def step_18_and_19(log: Interaction) -> None:
    """ "Please move that": the person looks at the face and comes to the piece too late."""
    log.tell(18, 40.0, STEP_18_AND_19)


def step_21(log: Interaction) -> None:
    """ "Please move this": followed; then only the table is looked at."""
    log.tell(21, 70.0, STEP_21)


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_step_5_both_references_succeed_and_the_manipulation_answers(resolution):
    log = Interaction(resolution)
    step_5_and_6(log)

    assert log.of(5) == [
        ("AP", (), "S"), ("DG", ("blue-square",), "S"), ("DG", ("rectangle",), "S"), ("MFG", (), "F"),
    ]  # fmt: skip
    answered = next(event for event in log.events if event.kind == "adjacency_pair" and event.state == "succeeded")
    assert (answered.response, answered.delay) == ("act", pytest.approx(3.7))


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_step_6_the_person_seeks_the_robots_face_and_finds_it(resolution):
    log = Interaction(resolution)
    step_5_and_6(log)
    facial = [event for event in log.events if event.kind == "mutual_facial_gaze" and event.at.seconds > 21.6]

    assert [(event.initiator, event.state) for event in facial] == [(HUMAN, "started"), (HUMAN, "succeeded")]
    assert facial[1].delay == pytest.approx(0.4)


@pytest.mark.parametrize(("resolution", "pink"), [("table", "S"), ("object", "F")])
def test_step_18_the_triangle_fails_and_the_square_depends_on_the_resolution(resolution, pink):
    log = Interaction(resolution)
    step_18_and_19(log)

    assert log.of(18) == [
        ("AP", (), "S"), ("DG", ("purple-triangle",), "F"), ("DG", ("pink-square",), pink), ("MFG", (), "F"),
    ]  # fmt: skip


@pytest.mark.parametrize(("resolution", "blue"), [("table", "S"), ("object", "F")])
def test_step_21_the_blue_piece_depends_on_the_resolution(resolution, blue):
    log = Interaction(resolution)
    step_21(log)

    assert log.of(21) == [
        ("AP", (), "S"), ("DG", ("green-square",), "S"), ("DG", ("blue-square",), blue), ("MFG", (), "F"),
    ]  # fmt: skip


@pytest.mark.parametrize(("resolution", "gazes"), [("table", {"S": 5, "F": 1}), ("object", {"S": 3, "F": 3})])
def test_the_three_moves_together(resolution, gazes):
    log = Interaction(resolution)
    for step in (step_5_and_6, step_18_and_19, step_21):
        step(log)
    decided = [decision for step in (5, 18, 21) for kind, _, decision in log.of(step) if kind == "DG"]

    assert Counter(decided) == gazes


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_step_20_thinking_aloud_answers_the_manipulation_and_ends_in_mutual_gaze(resolution):
    log = Interaction(resolution)
    log.begins(HUMAN, "act", 58.0, "purple-triangle")
    log.ends(HUMAN, "act", 60.0, "purple-triangle")
    log.tell(20, 60.5, """
        0 human table; 0.1 robot human; 0.4 asks; 0.4 says; 0.9 human face; 1 silent; 1.2 robot table
        2.5 says; 2.9 silent; 2.9 over; 3.1 robot human; 4.5 human table
    """)  # fmt: skip

    assert log.of(20) == [("AP", (), "F"), ("MFG", (), "S")]
    assert next((outcome.state, outcome.delay) for outcome in log.outcomes) == ("succeeded", 0.0)
    assert log.states("ap-1") == ["started", "succeeded", "completed"]


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_step_26_the_person_leaves_and_nothing_stays_open(resolution):
    log = Interaction(resolution)
    step_5_and_6(log)
    log.tell(25, 30.0, "0.4 asks; 0.4 says; 1 human face; 3 silent; 3 over; 3.3 done")
    log.lost(HUMAN, 34.0)
    log.until(60.0)

    ends = Counter(
        event.id for event in log.events if event.state in ("completed", "failed", "preempted", "withdrawn")
    )
    assert ends == Counter({event.id for event in log.events})
    assert log.session.deadline is None
