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

    def says(self, start: float, end: float, speech: str = "speech-1") -> None:
        """A piece of the robot's speech; what happens during it is fed by `during`."""
        self.begins(ROBOT, "speak", self.start + start, behavior=f"{self.block}:{speech}")
        self._silent_at, self._speech = end, speech

    def falls_silent(self) -> None:
        self.ends(ROBOT, "speak", self.start + self._silent_at, behavior=f"{self.block}:{self._speech}")

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

    def robot(self, target: str, at: float) -> None:
        self.looks(ROBOT, target, self.start + at)

    def human(self, target: str, at: float) -> None:
        self.looks(HUMAN, ROBOT if target == "face" else target, self.start + at)

    def turn_over(self, at: float) -> None:
        """The last word: the turn ends and the robot seeks the person's eyes."""
        self.signals("ended", self.start + at, turn=self.block, block=self.block)
        self.owner("fragment", HUMAN, self.start + at)
        self.requests_event(
            "mutual_facial_gaze", self.start + at, id=f"mfg-{self.step}", block=self.block, turn=self.block,
            optional=True,
        )  # fmt: skip

    def fragment(self, step: int, start: float) -> None:
        self.step, self.start = step, start
        self.owner("fragment", HUMAN, start)

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


def step_5_and_6(log: Interaction) -> None:
    """ "Please move the blue piece so that it is touching the top of the rectangle", and the person does."""
    log.human(TABLE, 0.0)
    log.fragment(5, 10.0)
    log.robot(HUMAN, 0.0)
    log.human("face", 0.2)
    log.asks(0.4, "act")
    log.says(0.4, 1.0)
    log.falls_silent()
    log.owner("fragment", "blue-square", 11.0)
    log.directs(1.0, "blue-square", phrase=1.9, point=1.9)
    log.says(1.9, 2.5, "blue-phrase")
    log.human("blue-square", 2.3)
    log.falls_silent()
    log.says(2.6, 4.6, "speech-2")
    log.robot(HUMAN, 2.9)
    log.human("rectangle", 3.4)
    log.falls_silent()
    log.owner("fragment", "rectangle", 14.6)
    log.directs(4.6, "rectangle", phrase=4.6)
    log.says(4.6, 5.3, "rectangle-phrase")
    log.falls_silent()
    log.turn_over(5.3)
    log.robot(HUMAN, 5.6)
    log.done(5.6)
    log.until(18.0)
    log.begins(HUMAN, "act", 19.0, "blue-square")
    log.robot("human-hand", 10.0)
    log.ends(HUMAN, "act", 21.5, "blue-square")
    log.human("face", 12.0)
    log.robot(HUMAN, 12.4)


def step_18_and_19(log: Interaction) -> None:
    """ "Please move that": the person looks at the face and comes to the piece too late."""
    log.fragment(18, 40.0)
    log.human("face", 0.0)
    log.robot(HUMAN, 0.1)
    log.asks(0.4, "act")
    log.says(0.4, 1.0)
    log.falls_silent()
    log.owner("fragment", "purple-triangle", 41.0)
    log.directs(1.0, "purple-triangle", phrase=1.9, point=1.9)
    log.says(1.9, 2.2, "that")
    log.falls_silent()
    log.until(44.4)
    log.says(4.5, 7.0, "speech-2")
    log.robot(HUMAN, 4.6)
    log.human(TABLE, 6.8)
    log.falls_silent()
    log.owner("fragment", "pink-square", 47.0)
    log.directs(7.0, "pink-square", phrase=7.0)
    log.says(7.0, 7.8, "pink-phrase")
    log.falls_silent()
    log.human("purple-triangle", 7.9)
    log.turn_over(7.9)
    log.robot(HUMAN, 8.2)
    log.done(8.2)
    log.until(51.0)
    log.begins(HUMAN, "act", 52.0, "purple-triangle")
    log.ends(HUMAN, "act", 54.0, "purple-triangle")


def step_21(log: Interaction) -> None:
    """ "Please move this": followed; then only the table is looked at."""
    log.fragment(21, 70.0)
    log.human(TABLE, 0.0)
    log.robot(HUMAN, 0.1)
    log.asks(0.4, "act")
    log.says(0.4, 1.0)
    log.human("face", 0.6)
    log.falls_silent()
    log.owner("fragment", "green-square", 71.0)
    log.directs(1.0, "green-square", phrase=1.9, point=1.9)
    log.human("green-square", 1.9)
    log.says(1.9, 2.2, "this")
    log.falls_silent()
    log.says(2.3, 4.4, "speech-2")
    log.robot(HUMAN, 2.5)
    log.human("face", 2.7)
    log.human(TABLE, 4.2)
    log.falls_silent()
    log.owner("fragment", "blue-square", 74.4)
    log.directs(4.4, "blue-square", phrase=4.4)
    log.says(4.4, 5.2, "blue-phrase")
    log.human("face", 4.9)
    log.human(TABLE, 5.1)
    log.falls_silent()
    log.turn_over(5.2)
    log.robot(HUMAN, 5.5)
    log.done(5.5)
    log.until(77.9)
    log.begins(HUMAN, "act", 79.0, "green-square")
    log.ends(HUMAN, "act", 81.0, "green-square")


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
    log.fragment(20, 60.5)
    log.human(TABLE, 0.0)
    log.robot(HUMAN, 0.1)
    log.asks(0.4)
    log.says(0.4, 1.0)
    log.human("face", 0.9)
    log.falls_silent()
    log.robot(TABLE, 1.2)
    log.says(2.5, 2.9, "speech-2")
    log.falls_silent()
    log.turn_over(2.9)
    log.robot(HUMAN, 3.1)
    log.human(TABLE, 4.5)

    assert log.of(20) == [("AP", (), "F"), ("MFG", (), "S")]
    assert next((outcome.state, outcome.delay) for outcome in log.outcomes) == ("succeeded", 0.0)
    assert log.states("ap-1") == ["started", "succeeded", "completed"]


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_step_26_the_person_leaves_and_nothing_stays_open(resolution):
    log = Interaction(resolution)
    step_5_and_6(log)
    log.fragment(25, 30.0)
    log.asks(0.4)
    log.says(0.4, 3.0)
    log.human("face", 1.0)
    log.falls_silent()
    log.turn_over(3.0)
    log.done(3.3)
    log.lost(HUMAN, 34.0)
    log.until(60.0)

    ends = Counter(
        event.id for event in log.events if event.state in ("completed", "failed", "preempted", "withdrawn")
    )
    assert ends == Counter({event.id for event in log.events})
    assert log.session.deadline is None
