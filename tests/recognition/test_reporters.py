"""What reporters say holds as long as they are there, and for a grace after that; a state shows what was missed."""

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.units import Stamp
from engage_hri.services.reports.action_reports import ActionReports
from engage_hri.services.reports.ongoing_actions import ActionEvent, GoesOn, TimedReport
from tests.recognition.observations import ROBOT, stamp

GRACE = 4.0
GONE = PeerGone(participant="cameras")


def alive(run: str = "one", name: str = "cameras") -> PeerAlive:
    return PeerAlive(participant=name, run=run)


def began(action: Action, at: float, *targets: str, actor: str = "ann", behavior: str = "") -> ActionBegan:
    return ActionBegan(actor=actor, action=action, at=stamp(at), targets=targets, behavior=behavior)


def ended(action: Action, at: float, *targets: str, actor: str = "ann") -> ActionEnded:
    return ActionEnded(actor=actor, action=action, at=stamp(at), targets=targets)


def found(at: float, actor: str = "ann") -> ActorFound:
    return ActorFound(actor=actor, at=stamp(at))


def lost(at: float, actor: str = "ann") -> ActorLost:
    return ActorLost(actor=actor, at=stamp(at))


def state(at: float, *actions: ActionBegan, seen: bool | None = True, actor: str = "ann") -> OngoingActions:
    return OngoingActions(actor=actor, at=stamp(at), actions=actions, seen=seen)


class World:
    """Reporters, and all that was told of what they say."""

    def __init__(self, *says: ActionEvent | OngoingActions) -> None:
        """says: what "cameras" have said, each at its own time."""
        self.reporters = ActionReports(ROBOT, GRACE, "loop", lambda stamp: stamp.seconds)
        self.presence(alive(), 0.0)
        for one in says:
            self.hears(one)

    def presence(self, message: PeerAlive | PeerGone, at: float) -> list[str]:
        return told(self._until(at) + self.reporters.feed(message, at))

    def hears(
        self, said: ActionEvent | OngoingActions, at: float | None = None, by: str = "cameras", life: str = "one"
    ) -> list[str]:
        at = said.at.seconds if at is None else at
        return told(self._until(at) + self.reporters.hear(said, by, life, at))

    def until(self, at: float) -> list[str]:
        return told(self._until(at))

    def _until(self, at: float) -> list[TimedReport]:
        found = []
        while (due := self.reporters.deadline) is not None and due <= at:
            found += self.reporters.advance(due)
            assert self.reporters.deadline != due, "a deadline that stays would spin"
        return found


def told(all_told: list[TimedReport]) -> list[str]:
    """Each in short: `5 ann +look robot`, `~` for what goes on, `?` for a time that is a guess."""
    return [_short(one) for one in all_told]


def _short(one: TimedReport) -> str:
    at, observation = f"{round(one.at, 4):g}{'' if one.is_sure else '?'}", one.observation
    match observation:
        case GoesOn(began=action, since=since):
            words = [at, action.actor, f"~{action.action}", *action.targets, f"since {since:g}"]
        case ActorFound() | ActorLost():
            words = [at, observation.actor, "found" if isinstance(observation, ActorFound) else "lost"]
        case _:
            sign = "+" if isinstance(observation, ActionBegan) else "-"
            words = [at, observation.actor, f"{sign}{observation.action}", *observation.targets]
    return " ".join(words)


# -- while it is there --------------------------------------------------------------------------------------------


def test_events_are_told_as_they_are_and_a_state_that_says_the_same_adds_nothing():
    world = World()

    assert world.hears(found(1.0)) == ["1 ann found"]
    assert world.hears(began("look", 2.0, "robot"), 2.1) == ["2 ann +look robot"]
    assert world.hears(state(2.1, began("look", 2.0, "robot"))) == []
    assert world.hears(ended("look", 3.0, "robot")) == ["3 ann -look robot"]
    assert world.hears(state(3.0)) == []
    assert world.hears(lost(4.0)) == ["4 ann lost"]
    assert world.hears(state(4.0, seen=False)) == []


def test_a_beginning_that_was_missed_is_told_with_its_own_time():
    world = World(found(1.0))

    assert world.hears(state(5.0, began("point", 4.5, "cup"))) == ["4.5 ann +point cup"]


def test_what_has_been_going_on_for_longer_than_the_history_goes_on_and_is_no_news():
    world = World()

    told = world.hears(state(1.0, began("look", 1.0, "robot"), began("speak", 0.5)), 21.0)

    assert told == ["1? ann found", "21 ann ~look robot since 1", "21 ann ~speak since 0.5"]


def test_an_end_that_was_missed_is_told_by_the_last_change():
    world = World(found(1.0), began("speak", 2.0), began("look", 3.0, "robot"))

    assert world.hears(state(9.0, began("look", 3.0, "robot")), 9.5) == ["9? ann -speak"]


def test_a_look_that_was_missed_ends_the_last_one_when_it_began():
    world = World(found(1.0), began("look", 2.0, "robot"))

    assert world.hears(state(9.0, began("look", 8.0, "cup"))) == ["8? ann -look robot", "8 ann +look cup"]


def test_the_same_action_that_has_begun_anew_has_ended_before():
    world = World(found(1.0), began("speak", 2.0))

    assert world.hears(state(9.0, began("speak", 8.0))) == ["8? ann -speak", "8 ann +speak"]


def test_somebody_who_was_lost_unnoticed_is_lost_and_does_nothing_new():
    world = World(found(1.0), began("look", 2.0, "robot"))

    told = world.hears(state(9.0, began("look", 2.0, "robot"), began("speak", 8.0), seen=False))

    assert told == ["9? ann lost"]


def test_somebody_found_again_goes_on_with_what_the_reporter_says():
    """A camera that has lost a face for a while does not say again that a look has begun."""
    world = World(
        found(1.0), began("look", 2.0, "robot"), lost(3.0), state(3.0, began("look", 2.0, "robot"), seen=False)
    )
    world.hears(found(3.8))

    assert world.hears(state(3.8, began("look", 2.0, "robot"))) == ["3.8 ann ~look robot since 2"]


def test_one_who_only_tells_events_takes_a_loss_for_the_end_of_all():
    world = World(found(1.0), began("look", 2.0, "robot"), lost(3.0), found(8.0))
    world.presence(GONE, 9.0)

    assert world.presence(alive(), 10.0) == []
    assert world.until(20.0) == ["10.5? ann found"]


def test_a_state_that_an_event_has_overtaken_changes_nothing():
    world = World(found(1.0), began("speak", 5.0))

    assert world.hears(state(4.0), 5.1) == []
    assert world.hears(state(5.0), 5.2) == ["5? ann -speak"]


def test_what_two_clocks_tell_is_in_the_order_in_which_it_comes():
    world = World(found(1.0), began("speak", 5.0))

    told = world.hears(OngoingActions(actor="ann", at=Stamp("other", 4.0), seen=True), 5.2)

    assert told == ["5? ann -speak"]


def test_an_end_without_targets_ends_all_of_its_kind():
    world = World(found(1.0), began("point", 2.0, "cup"), began("point", 2.5, "bowl"), ended("point", 3.0))

    assert world.hears(state(3.0)) == []


def test_nothing_is_kept_of_somebody_who_is_not_seen_and_does_nothing():
    world = World(state(1.0, seen=False), state(1.0, seen=None, actor="bob"))
    world.presence(GONE, 2.0)

    assert world.until(100.0) == []
    assert world.reporters._reporters == {}


# -- gone and back ------------------------------------------------------------------------------------------------


def watching() -> World:
    """cameras have told of ann and bob, others of eve."""
    world = World(found(1.0, "bob"), found(1.0), began("speak", 1.0))
    world.hears(began("speak", 1.0, actor="eve"), by="others", life="x")
    return world


def test_what_a_reporter_said_holds_for_the_grace():
    world = watching()
    world.presence(GONE, 2.0)

    assert world.until(5.9) == []
    assert world.presence(alive(), 5.9) == []
    assert world.until(20.0) == ["6.4? ann found", "6.4 ann ~speak since 1", "6.4? bob found"]


def test_after_the_grace_all_of_it_has_ended_when_the_reporter_went():
    world = watching()
    world.presence(GONE, 2.0)

    assert world.until(6.0) == ["2? ann -speak", "2? ann lost", "2? bob lost"]
    assert world.until(100.0) == []


def test_the_same_life_goes_on_after_it_has_caught_up():
    world = watching()
    world.presence(GONE, 2.0)
    world.until(6.0)

    assert world.presence(alive(), 10.0) == []
    assert world.hears(ended("speak", 4.0), 10.1) == ["4 ann -speak"]
    assert world.until(20.0) == ["10.5? ann found", "10.5? bob found"]


def test_what_comes_after_that_is_not_told_for_a_time_before_it():
    """Else it would be older than what has been assumed, and count for nothing."""
    world = watching()
    world.presence(GONE, 2.0)
    world.presence(alive(), 10.0)
    world.until(10.5)

    late = [*world.hears(began("look", 4.0, "cup"), 11.0), *world.hears(lost(5.0), 11.0)]
    assert late == ["10.5? ann +look cup", "10.5? ann lost"]


def test_what_a_dead_reporter_said_in_time_but_comes_too_late_waits_for_its_return():
    world = watching()
    world.presence(GONE, 2.0)
    world.until(6.0)

    assert world.hears(began("look", 1.9, "cup"), 7.0) == []
    world.presence(alive(), 8.0)
    assert "8.5 ann ~look cup since 1.9" in world.until(9.0)


def test_another_life_ends_what_the_last_one_said_and_has_yet_to_see_them():
    world = watching()
    world.presence(GONE, 2.0)

    assert world.presence(alive("two"), 3.0) == ["2? ann -speak", "2? ann lost", "2? bob lost"]
    world.presence(GONE, 4.0)
    world.presence(alive("two"), 5.0)
    assert world.until(20.0) == []


def test_another_life_shows_by_its_first_message_too():
    world = watching()

    assert world.hears(found(3.0), life="two") == ["3? ann -speak", "3? ann lost", "3? bob lost", "3? ann found"]
    assert world.presence(alive("two"), 3.1) == []


def test_what_a_life_that_has_gone_said_counts_for_nothing():
    world = watching()
    world.presence(GONE, 2.0)
    world.presence(alive("two"), 3.0)

    assert world.hears(began("look", 1.5, "cup"), 3.1, life="one") == []
    assert world.hears(found(3.2), life="two") == ["3.2 ann found"]


def test_the_history_of_a_life_before_the_present_one_counts_for_nothing():
    world = World()

    assert told(world.reporters.hear(found(0.5), "cameras", "zero", 1.0, past=True)) == []
    assert told(world.reporters.hear(found(0.6), "cameras", "one", 1.0, past=True)) == ["0.6 ann found"]


def test_what_was_missed_of_a_short_loss_shows_when_the_person_is_found():
    """The person has not left for recognition, so that nothing has ended by itself."""
    world = World(found(1.0), began("look", 2.0, "robot"), state(2.0, began("look", 2.0, "robot")))
    for said in (lost(3.0), state(3.0, began("look", 2.0, "robot"), seen=False), found(3.2)):
        world.hears(said)

    assert world.hears(state(3.2)) == ["3.2? ann -look robot"]


def test_of_two_of_one_name_none_is_deaf_for_ever():
    """There was no news that the first had gone: both may be there."""
    world = watching()
    world.presence(alive("two"), 3.0)

    assert world.hears(found(4.0), life="one")[-1] == "4? ann found"


def test_a_link_that_flaps_ends_nothing():
    world = watching()
    for at in range(2, 40, 2):
        assert not any("lost" in each or " -" in each for each in world.presence(GONE, at))
        assert not any("lost" in each or " -" in each for each in world.presence(alive(), at + 0.3))


def test_the_robot_is_never_lost():
    world = World()
    world.presence(alive("body", "control"), 0.0)
    speech = began("speak", 1.0, actor=ROBOT, behavior="b:s")
    world.hears(speech, by="control", life="body")
    world.presence(PeerGone(participant="control"), 2.0)

    assert world.until(6.0) == ["2? robot -speak"]
    world.presence(alive("body", "control"), 7.0)
    assert world.until(8.0) == ["7.5 robot ~speak since 1"]


def test_others_who_come_and_go_change_nothing():
    world = watching()
    kept = set(world.reporters._reporters)

    assert world.presence(PeerGone(participant="generation"), 2.0) == []
    assert world.presence(alive("x", "generation"), 3.0) == []
    assert world.presence(PeerGone(participant="generation"), 4.0) == []
    assert set(world.reporters._reporters) == kept


# -- two reporters of one person ----------------------------------------------------------------------------------


def both() -> World:
    world = World(found(1.0), began("speak", 1.0), began("look", 1.0, "cup"))
    world.presence(alive("m", "others"), 1.0)
    for said in (found(1.0), began("speak", 1.0)):
        world.hears(said, by="others", life="m")
    return world


def test_what_another_says_too_does_not_end_with_one():
    world = both()
    world.presence(GONE, 2.0)

    assert world.until(6.0) == ["2? ann -look cup"]


def test_whom_another_sees_is_not_lost():
    world = both()

    assert world.hears(lost(2.0)) == ["2? ann -look cup"]
    assert world.hears(lost(3.0), by="others", life="m") == ["3 ann lost"]


def test_a_live_word_beats_that_of_one_who_is_away_and_the_other_is_asked_when_it_is_back():
    world = both()
    world.presence(GONE, 2.0)

    assert world.hears(lost(3.0), by="others", life="m") == ["3 ann lost"]
    world.presence(alive(), 4.0)
    assert world.until(5.0) == ["4.5? ann found", "4.5 ann ~speak since 1", "4.5 ann ~look cup since 1"]


def test_who_is_away_for_a_moment_still_counts_when_the_other_ends():
    world = both()
    world.presence(PeerGone(participant="others"), 2.0)
    world.presence(GONE, 5.0)

    assert world.until(6.0) == []
    world.presence(alive(), 7.0)
    assert world.until(20.0) == ["7.5? ann found", "7.5 ann ~speak since 1", "7.5 ann ~look cup since 1"]


def test_a_program_without_a_token_keeps_nobody():
    world = World(found(1.0))
    world.hears(found(1.0), by="", life="")
    world.hears(state(1.0), by="foreign", life="")

    assert world.hears(lost(2.0)) == ["2 ann lost"]


# -- strangers ----------------------------------------------------------------------------------------------------


def test_a_program_that_only_sends_events_is_told_as_ever():
    world = World()
    said = [found(1.0), began("speak", 2.0), ended("speak", 3.0), lost(4.0), found(5.0), began("nod", 6.0)]

    heard = [each for one in said for each in world.hears(one, by="", life="zid")]

    assert heard == ["1 ann found", "2 ann +speak", "3 ann -speak", "4 ann lost", "5 ann found", "6 ann +nod"]
    assert world.until(1000.0) == []
