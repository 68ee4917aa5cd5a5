"""Several people: only what is said to the robot opens or answers its pairs; its words answer whom they are for."""

from collections.abc import Iterable
from typing import Any

from engage_hri.schemas.behaviors import TurnSignal
from engage_hri.schemas.recognition import ConnectionEvent, SignalTurn
from engage_hri.services.recognition.events.scene import Worded
from tests.recognition.observations import ROBOT, Log, request_event, stamp
from tests.stories import Story, each

STORIES = """
two who talk with each other tell the robot nothing
    1 ann looks bob; 1 bob looks ann; 1.5 ann speaks 2; 3.8 bob speaks 1; 5 ann speaks 1; 20 end
    nothing

who looks at the robot speaks to it
    1 ann looks robot; 1.5 ann speaks 2; 20 end
    ann: started 1.5, failed 7.5

what perception says counts before the looks
    1 ann looks bob; 1.5 ann speaks 2 to=robot; 20 end
    ann: started 1.5, failed 7.5

... also if it tells of somebody else
    1 ann looks robot; 1.5 ann speaks 2 to=bob; 20 end
    nothing

... and if it tells it only with the words
    0.1 ann speaks 0.2 to=bob; 1 ann looks robot; 1.5 ann speaks 2; 4.2 ann said 1.5 to=bob; 20 end
    nothing

most of the look counts
    1 ann looks robot; 1.5 ann speaks 2; 1.9 ann looks bob; 20 end
    nothing

the robot's name calls it
    1 ann looks bob; 1.5 ann speaks 2; 2.5 ann said 1.5 words=hello,robot; 20 end
    ann: started 1.5, failed 7.5

who thinks looks at nobody, and answers who has asked
    1 robot asks ann 2; 3.6 ann speaks 1; 20 end
    robot: started 1, succeeded 3.6 after 0.6, completed 4.6

... however long that takes, while the robot waits
    1 robot asks ann 2 limit=20; 12 ann speaks 1; 30 end
    robot: started 1, succeeded 12 after 9, completed 13

... also if somebody says a little to her within its question
    0.5 robot asks ann 5; 4 bob looks ann; 4.8 bob speaks 0.3; 6.5 ann speaks 1; 30 end
    robot: started 0.5, succeeded 6.5 after 1, completed 7.5

... but who asks her and still speaks when the robot is silent is answered
    0.5 bob looks ann; 1 bob speaks 6; 2 robot asks ann 3; 6.5 ann speaks 1; 30 end
    robot: started 2, failed 9

an answer to another is none
    1 robot asks ann 2; 2 ann looks bob; 3.6 ann speaks 1; 20 end
    robot: started 1, failed 7

whom an answer is for is known after three seconds
    1 robot asks ann 2; 2 ann looks robot; 3.6 ann speaks 9; 6.7 known
    robot: started 1, succeeded 3.6 after 0.6

... once: the next goes where her own words went
    1 robot asks ann 1; 2.2 ann looks bob; 2.3 ann speaks 1; 3.4 ann looks nobody; 3.5 ann speaks 1; 20 end
    robot: started 1, failed 6

who has answered, and makes a sound without words, says no more
    0 ann said 0 to=bob; 1 robot asks ann 2; 3.6 ann speaks 1; 4.6 ann said 3.6; 5.5 ann speaks 1; 20 end
    robot: started 1, succeeded 3.6 after 0.6, completed 4.6

somebody else answers
    1 robot asks ann 2; 2 bob looks robot; 3.6 bob speaks 1; 20 end
    robot: started 1, preempted 3.6 after 0.6 by bob

somebody else talks with somebody else
    1 robot asks ann 2; 2 bob looks ann; 3.6 bob speaks 1; 20 end
    robot: started 1, failed 7

the robot's words to another answer nobody else
    1 ann looks robot; 1.5 ann speaks 1; 3 robot asks bob 2; 20 end
    ann: started 1.5, failed 6.5
    robot: started 3, failed 9

... and its words to her do
    1 ann looks robot; 1.5 ann speaks 1; 3 robot asks ann 2; 20 end
    ann: started 1.5, succeeded 3 after 0.5, completed 3
    robot: started 3, failed 9

two talk while the robot speaks to a third
    1 ann looks bob; 1 bob looks ann; 2 robot asks cy 4; 2.5 ann speaks 1; 3.7 bob speaks 1; 20 end
    robot: started 2, failed 10

one asks another, who answers, and the robot speaks
    1 ann looks bob; 1 bob looks ann; 2 ann speaks 1; 3.2 bob speaks 1; 4.4 robot asks ann 1; 20 end
    robot: started 4.4, failed 9.4

a side participant nods
    1 robot asks ann 3; 1 bob looks robot; 2 bob nods 0.4; 20 end
    robot: started 1, failed 8

the addressee nods
    1 robot asks ann 3; 1 ann looks robot; 2 ann nods 0.4; 20 end
    robot: started 1, failed 8
    robot bc: started 2.4, succeeded 2.4, completed 2.4

a nod at another is not for the robot
    1 robot asks ann 1; 1 ann looks bob; 2.5 ann nods 0.4; 20 end
    robot: started 1, failed 6

what the robot asks while it is not known to whom she speaks is told in its turn
    1 ann speaks 2; 2 robot asks ann 1; 2.5 ann looks bob; 20 end
    robot: started 2, failed 7

of two who are asked one answers for both
    1 robot asks ann,bob 2; 2 bob looks robot; 3.6 bob speaks 1; 20 end
    robot: started 1, succeeded 3.6 after 0.6 by bob, completed 3.6 by bob
    robot: started 1, succeeded 3.6 after 0.6 by bob, completed 4.6 by bob

... with a nod, too
    1 robot asks ann,bob 2; 2 bob looks robot; 3.6 bob nods 0.4; 20 end
    robot: started 1, succeeded 3.6 after 0.6 by bob, completed 3.6 by bob
    robot: started 1, succeeded 3.6 after 0.6 by bob, completed 4 by bob

... who begins before the question is over
    1 robot asks ann,bob 2; 2 bob looks robot; 2.8 bob speaks 1; 20 end
    robot: started 1, succeeded 3 after -0.2 by bob, completed 3 by bob
    robot: started 1, succeeded 3 after -0.2 by bob, completed 3.8 by bob

... or interrupts it for good
    1 robot asks ann,bob 2 cut=1; 2 bob looks robot; 2.2 bob speaks 2; 20 end
    robot: started 1, succeeded 3 after -0.8 by bob, completed 3 by bob
    robot: started 1, succeeded 3 after -0.8 by bob, completed 4.2 by bob

if nobody answers, both have not
    1 robot asks ann,bob 2; 20 end
    robot: started 1, failed 7
    robot: started 1, failed 7

if both answer, each has
    1 robot asks ann,bob 2; 2 ann looks robot; 2 bob looks robot; 2.8 ann speaks 1; 2.9 bob speaks 1; 20 end
    robot: started 1, succeeded 3 after -0.2 by ann, completed 3.8 by ann
    robot: started 1, succeeded 3 after -0.1 by bob, completed 3.9 by bob

who was not asked answers for nobody
    1 robot asks ann,bob 2; 2 cy looks robot; 3.6 cy speaks 1; 20 end
    robot: started 1, preempted 3.6 after 0.6 by cy
    robot: started 1, preempted 3.6 after 0.6 by cy

of two who begin at once who was asked answers, and the other has a turn of their own
    1 robot asks bob 2; 3.5 ann looks robot; 3.6 ann speaks 1; 3.6 bob speaks 1; 3.7 bob looks robot; 20 end
    robot: started 1, succeeded 3.6 after 0.6, completed 4.6
    ann: started 3.6, failed 8.6

the first words of all call the robot, although nobody knew that words would come
    1 ann speaks 1; 2.3 ann said 1 words=robot,help,me; 20 end
    ann: started 1, failed 6

... or perception tells with them that they are for it
    1 ann speaks 1; 2.3 ann said 1 to=robot; 20 end
    ann: started 1, failed 6

... or tells that without words
    1 ann speaks 1; 2.3 ann said 1 words= to=robot; 20 end
    ann: started 1, failed 6

... also if she looks at somebody else
    1 ann looks bob; 1.5 ann speaks 1; 2.8 ann said 1.5 words=robot,help,me; 20 end
    ann: started 1.5, failed 6.5

... and they answer what it has asked
    1 robot asks ann 2; 2 ann looks bob; 3.6 ann speaks 1; 4.9 ann said 3.6 words=robot,the,red; 20 end
    robot: started 1, succeeded 3.6 after 0.6, completed 4.6

... but first words that call nobody are for whom she looks at
    1 ann looks bob; 1.5 ann speaks 1; 2.8 ann said 1.5 words=help,me; 20 end
    nothing

the words of a long speech call the robot when it is over
    0 bob said 0; 1 ann looks bob; 1.5 ann speaks 5; 6.8 ann said 1.5 words=robot,help,me; 20 end
    ann: started 1.5, failed 10.5

... or while it goes on
    0 bob said 0; 1 ann looks bob; 1.5 ann speaks 5; 5 ann said 1.5 words=robot,help,me; 20 end
    ann: started 1.5, failed 10.5

... as soon as so much of them is known
    0 bob said 0; 1 ann looks bob; 1.5 ann speaks 5; 5 ann said 1.5; 6.8 ann said 1.5 words=robot,help; 20 end
    ann: started 1.5, failed 10.5

a neighbor's sound that may still be a cough takes no answer from the robot
    0 ann said 0; 1 robot asks bob 1; 2 ann looks bob; 2 ann speaks 2; 3 bob speaks 1.2; 4.3 bob said 3; 9 end
    robot: started 1, succeeded 3 after 1, completed 4.2

what she says to another into the question is no answer, if perception says so, although she looks at the robot
    0 ann said 0; 1 robot asks ann 5; 2 ann looks robot; 3 ann speaks 0.6; 3.9 ann said 3 to=bob; 20 end
    robot: started 1, failed 10

... or her words do
    0 ann said 0; 1 robot asks ann 5; 2 ann looks robot; 3 ann speaks 0.6; 3.9 ann said 3 words=bob,the,red; 20 end
    robot: started 1, failed 10

... also while she says them
    0 ann said 0; 1 robot asks ann 5; 2 ann looks robot; 3 ann speaks 2; 3.9 ann said 3 words=bob,the,red; 20 end
    robot: started 1, failed 10

... and she answers afterwards
    0 ann said 0; 1 robot asks ann 5; 2 ann looks robot; 3 ann speaks 2; 3.9 ann said 3 to=bob; 7 ann speaks 1
    8 ann said 7; 20 end
    robot: started 1, succeeded 7 after 1, completed 8

... also if it was taken for noise before they came
    0 ann said 0; 1 robot asks ann 5; 2 ann looks robot; 3 ann speaks 1; 5 ann said 3 words=bob,the,red; 20 end
    robot: started 1, failed 10

who interrupts before the turn is cut off has answered, also if it is not decided yet, and for all who were asked
    0 ann said 0; 1 robot asks ann,bob 2 cut=1; 2 bob looks robot; 2.2 bob speaks 0.4; 3.2 bob said 2.2; 20 end
    robot: started 1, succeeded 3 after -0.8 by bob, completed 3 by bob
    robot: started 1, succeeded 3 after -0.8 by bob, completed 3 by bob

of two who interrupt the first answers for who is silent, also if it is decided later
    0 ann said 0; 1 robot asks ann,bob,cy 5; 2 ann looks robot; 2 bob looks robot; 3 ann speaks 4; 4 bob speaks 0.5
    4.6 bob said 4 words=stop; 7.1 ann said 3 words=wait,a,bit; 20 end
    robot: started 1, succeeded 6 after -3 by ann, completed 7 by ann, completed 7.1 by ann
    robot: started 1, succeeded 6 after -2 by bob, completed 6 by bob
    robot: started 1, succeeded 6 after -3 by ann, completed 6 by ann, completed 7.1 by ann

a laugh after a question is no answer
    0 ann said 0; 1 robot asks ann 2; 2 ann looks robot; 3.5 ann speaks 0.8; 20 end
    robot: started 1, failed 7

... what comes after it is
    0 ann said 0; 1 robot asks ann 2; 2 ann looks robot; 3.5 ann speaks 0.8; 5 ann speaks 0.4; 5.6 ann said 5; 20 end
    robot: started 1, succeeded 5 after 2, completed 5.4

... and so is the sound if its words come late
    0 ann said 0; 1 robot asks ann 2; 2 ann looks robot; 3.5 ann speaks 0.4; 6 ann said 3.5; 20 end
    robot: started 1, succeeded 3.5 after 0.5, completed 3.9

... or when nobody waits any longer
    0 ann said 0; 1 robot asks ann 2; 2 ann looks robot; 3.5 ann speaks 0.4; 9 ann said 3.5; 20 end
    robot: started 1, failed 7, failed 7

... but not if the robot has asked something else meanwhile
    0 ann said 0; 1 robot asks ann 2; 2 ann looks robot; 3.5 ann speaks 0.4; 5 robot asks ann 1; 7 ann said 3.5; 9 end
    robot: started 1, superseded 5
    robot: started 5, failed 10

a sound that lasts is speech, although its words have not come
    0 ann said 0; 1 robot asks ann 2; 2 ann looks robot; 3.5 ann speaks 5; 7 known
    robot: started 1, succeeded 3.5 after 0.5

where nobody tells words a sound is speech
    1 robot asks ann 2; 2 ann looks robot; 3.5 ann speaks 0.8; 20 end
    robot: started 1, succeeded 3.5 after 0.5, completed 4.3

talk to a neighbor is no answer, although the head turns only with the voice
    1 robot asks ann,bob 2; 2 ann looks robot; 2 bob looks robot; 4 ann speaks 2; 4.1 ann looks bob; 30 end
    robot: started 1, failed 7
    robot: started 1, failed 7

a late answer has to come before the robot speaks to anybody
    1 robot asks ann 1; 2 ann looks robot; 9 robot asks bob 1; 14 ann speaks 1; 30 end
    robot: started 1, failed 6
    robot: started 9, preempted 14 after 4 by ann

who stands by and says "uh-huh" to the robot listens
    0 ann said 0; 1 robot asks ann 4; 1 bob looks robot; 2 bob speaks 0.4; 2.6 bob said 2 words=uh-huh; 20 end
    robot: started 1, failed 9
    robot bc: started 2.4, succeeded 2.4, completed 2.4

... who laughs gives no sign of it
    0 ann said 0; 1 robot asks ann 4; 1 bob looks robot; 2 bob speaks 0.4; 20 end
    robot: started 1, failed 9

... and who says something else has a turn
    0 ann said 0; 1 robot asks ann 4; 1 bob looks robot; 2 bob speaks 0.4; 2.6 bob said 2 words=wait; 20 end
    robot: started 1, failed 9
    bob: started 2, failed 6.4

... or goes on when the robot is silent
    0 ann said 0; 1 robot asks ann 4; 1 bob looks robot; 4.8 bob speaks 0.4; 5.6 bob said 4.8 words=uh-huh; 20 end
    robot: started 1, failed 9
    bob: started 4.8, failed 9.2

words that come late say nothing if a second speech has begun, also if it is not decided yet
    0 ann said 0; 1 robot asks ann 2; 3.5 ann speaks 0.3; 5.4 ann speaks 1; 6 ann said 3.5; 6.5 ann said 5.4; 30 end
    robot: started 1, succeeded 5.4 after 2.4, completed 6.4

... or if that has been heard before
    0 ann said 0; 2 ann looks robot; 3.5 ann speaks 0.3; 5.5 ann speaks 1; 6.6 ann said 5.5; 7 ann said 3.5; 30 end
    ann: started 5.5, failed 10.5

... or the robot has had its answer
    0 ann said 0; 3 ann speaks 0.3; 5 robot asks ann 1; 7 ann speaks 1; 8 ann said 7; 9 ann said 3; 30 end
    robot: started 5, succeeded 7 after 1, completed 8

words that end just before the robot's, and are known after these, answer
    0 ann said 0; 1 robot asks ann 3; 2 ann looks robot; 3.2 ann speaks 0.6; 4.2 ann said 3.2 words=the,blue; 30 end
    robot: started 1, succeeded 4 after -0.8, completed 4

... or are a listener's
    0 ann said 0; 1 robot asks ann 3; 2 ann looks robot; 3.2 ann speaks 0.6; 4.2 ann said 3.2 words=uh-huh; 30 end
    robot: started 1, failed 8
    robot bc: started 3.8, succeeded 3.8, completed 3.8

... and a turn of who stands by
    0 ann said 0; 1 robot asks ann 3; 1 bob looks robot; 3.2 bob speaks 0.6; 4.2 bob said 3.2 words=the,blue; 30 end
    robot: started 1, failed 8
    bob: started 3.2, failed 7.8

... also when words come long after, if neither has spoken since
    0 ann said 0; 1 robot asks ann 3; 1 bob looks robot; 2 bob speaks 0.4; 5.5 bob said 2 words=where,to; 30 end
    robot: started 1, failed 8
    bob: started 2, failed 6.4

... and a listener's words that come late are a backchannel
    0 ann said 0; 1 robot asks ann 3; 1 bob looks robot; 2 bob speaks 0.4; 5.5 bob said 2 words=uh-huh; 30 end
    robot: started 1, failed 8
    robot bc: started 2.4, succeeded 2.4, completed 2.4

... but nothing of either if the robot has spoken to them since
    0 ann said 0; 1 robot asks ann 1; 1 bob looks robot; 1.5 bob speaks 0.3; 4 robot asks bob 1; 6 bob said 1.5; 9 end
    robot: started 1, failed 6
    robot: started 4, failed 9

... also if what the robot has asked them waits until it is known whether somebody else has answered
    0 ann said 0; 3 ann looks robot; 3.5 ann speaks 0.3; 4 bob speaks 2; 4.5 robot asks ann 1; 5 ann said 3.5; 30 end
    robot: started 4.5, failed 9.5

who has interrupted a turn that is cut off has answered for all, also if they begin anew when it is
    0 ann said 0; 3 ann speaks 0.4; 3.5 ann said 3; 4 ann speaks 1; 1 robot asks ann,bob 3 cut=1; 30 end
    robot: started 1, succeeded 4 after -1 by ann, completed 4 by ann
    robot: started 1, succeeded 4 after -1 by ann, completed 4 by ann

... also if it is not known yet to whom another speaks who began before
    0 cy said 0; 3 bob speaks 3; 4 ann speaks 1; 1 robot asks ann,bob 3 cut=1; 5 ann said 4; 6 bob said 3 to=cy; 9 end
    robot: started 1, succeeded 4 after 0 by ann, completed 5 by ann
    robot: started 1, succeeded 4 after 0 by ann, completed 4 by ann

who has answered has answered for all, also while another who was asked interrupts the next turn
    1 robot asks ann,bob,cy 1; 3 robot asks ann 6; 3 ann looks robot; 4 ann speaks 2; 4.5 bob speaks 1; 9 end
    robot: started 1, superseded 3
    robot: started 1, succeeded 4.5 after 2.5 by bob, completed 5.5 by bob
    robot: started 1, succeeded 4.5 after 2.5 by bob, completed 4.5 by bob
    robot: started 3, succeeded 9 after -5, completed 9

... before their own next words count, if it was not known until then to whom another speaks
    1 robot asks ann,bob 2; 3 bob looks ann; 3.2 bob speaks 2.5; 3.5 ann speaks 0.5; 4.5 ann speaks 1; 9 end
    robot: started 1, succeeded 3.5 after 0.5 by ann, completed 4 by ann
    robot: started 1, succeeded 3.5 after 0.5 by ann, completed 3.5 by ann
    ann: started 4.5, failed 9.5

noise in the robot's turn is the answer if its words come after the turn
    0 ann said 0; 1 robot asks ann 3; 1 ann looks robot; 3 ann speaks 0.4; 6 ann said 3 words=wait; 30 end
    robot: started 1, succeeded 4 after -1, completed 4

a nod beside a listener's words that come late is one backchannel with them
    0 ann said 0; 1 robot asks ann 9; 2 ann nods 0.4; 2 ann speaks 0.4; 6 ann said 2 words=hm; 9 end
    robot: started 1, failed 14
    robot bc: started 2.4, succeeded 2.4, completed 2.4

a nod of who looks at nobody is for the robot that asks, also before it is known to whom her words before are
    0 bob said 0 to=cy; 0.5 ann speaks 1; 1 robot asks ann 3; 1.6 ann nods 0.4; 2.4 ann said 0.5 to=bob; 20 end
    robot: started 1, failed 8
    robot bc: started 2, succeeded 2, completed 2

a nod waits until it is known whether somebody has answered before
    1 robot asks ann 2; 2 ann looks robot; 2 bob looks robot; 4 bob speaks 2; 5 ann nods 0.4; 30 end
    robot: started 1, preempted 4 after 1 by bob

somebody's early words answer for both who were asked, also if one of them speaks meanwhile
    1 robot asks ann,bob 2; 2 ann looks robot; 2 cy looks robot; 4 cy speaks 0.6; 4.5 ann speaks 0.6; 20 end
    robot: started 1, preempted 4 after 1 by cy
    robot: started 1, preempted 4 after 1 by cy
    ann: started 4.5, failed 9.1

a cough of who looks at her takes the answer from no question, also in the robot's words
    0 ann said 0; 1 robot asks ann 3; 3 bob looks ann; 3.2 bob speaks 0.3; 5 ann speaks 0.6; 5.9 ann said 5; 30 end
    robot: started 1, succeeded 5 after 1, completed 5.6

a typed line is for the robot
    1 ann looks bob; 2 ann types hello; 20 end
    ann: started 2, failed 6
"""


def test_what_another_answers_is_told_with_the_words_of_that() -> None:
    for asked, others in (("ann",), ("preempted",)), (("ann", "cy"), ("preempted", "preempted")):
        log = Log("ann", "bob", "cy")
        asks = f"1 robot asks {','.join(asked)} 2"
        steps = [asks, "3 bob looks robot", "3.1 bob speaks 1", "4.5 bob said 3.1 words=the,blue,one"]
        for at, _, feed in sorted(_spelled_out(log, steps), key=lambda each: each[:2]):
            log.until(at - 1e-6)
            feed()
        told = {event.id: event for event in log.events if event.initiator == ROBOT}

        assert tuple(event.state for event in told.values()) == others
        assert {(event.answered_by, event.words) for event in told.values()} == {("bob", "the blue one")}


@each(STORIES)
def test_several_people(story: Story) -> None:
    log = Log("ann", "bob", "cy", adjacency_pair_limit=4.0)
    *steps, last = story.steps
    over, what = last.split()
    for at, _, feed in sorted(_spelled_out(log, steps), key=lambda each: each[:2]):
        if what == "known" and at > float(over):
            break
        log.until(at - 1e-6)
        feed()
    log.until(float(over) if what == "known" else 100.0)

    assert (_lives(log.events) or ["nothing"]) == story.becomes


def _spelled_out(log: Log, steps: list[str]) -> Iterable[tuple[float, int, Any]]:
    for number, step in enumerate(steps):
        time, who, *words = step.split()
        at = float(time)
        plain = [word for word in words if "=" not in word]
        named = dict(word.split("=") for word in words if "=" in word)
        match plain:
            case ["looks", target]:
                yield at, number, lambda at=at, who=who, target=target: log.looks(who, target, at)
            case ["speaks" | "nods" as action, lasts]:
                action = "speak" if action == "speaks" else "nod"
                end = at + float(lasts)
                if "to" in named:
                    to = frozenset((named["to"],))
                    told = Worded(actor=who, since=at, text="", to=to)
                    yield at, number, lambda told=told, at=at: log.feed(told, at)
                yield at, number, lambda at=at, who=who, a=action: log.begins(who, a, at)
                yield end, number, lambda end=end, who=who, a=action: log.ends(who, a, end)
            case ["types", text]:
                line = Worded(actor=who, since=at, text=text, is_alone=True, is_line=True)
                yield at, number, lambda line=line, at=at: log.feed(line, at)
                yield at, number, lambda at=at, who=who: log.begins(who, "speak", at)
                yield at, number, lambda at=at, who=who: log.ends(who, "speak", at)
            case ["said", since]:
                to = frozenset((named["to"],)) if "to" in named else None
                worded = Worded(actor=who, since=float(since), text=named.get("words", "so").replace(",", " "), to=to)
                yield at, number, lambda worded=worded, at=at: log.feed(worded, at)
            case ["asks", person, lasts]:
                end, block, cut = at + float(lasts), f"block-{number}", "cut" in named
                for one in person.split(","):
                    asked = request_event(
                        "adjacency_pair", at, request=f"{block}/{one}", block=block, turn=block, responder=one,
                        limit=float(named["limit"]) if "limit" in named else None,
                    )  # fmt: skip
                    yield at, number, lambda at=at, asked=asked: log.feed(asked, at)
                yield at, number, lambda at=at, b=block: log.begins(ROBOT, "speak", at, behavior=f"{b}:s")
                yield end, number, lambda end=end, b=block: log.ends(ROBOT, "speak", end, behavior=f"{b}:s")
                signal = TurnSignal(
                    id="e", turn=block, signal="aborted" if cut else "ended", actor="" if "," in person else person
                )
                ended = SignalTurn(id=f"{block}/e", requester="realizer", signal=signal, at=stamp(end), block=block)
                yield end, number, lambda ended=ended, end=end: log.feed(ended, end)


def _lives(events: list[ConnectionEvent]) -> list[str]:
    lines: dict[str, str] = {}
    for event in events:
        if event.kind not in ("adjacency_pair", "backchannel"):
            continue
        line = lines.get(event.id, f"{event.initiator}{' bc' if event.kind == 'backchannel' else ''}:")
        after = (
            f" after {event.delay:g}" if event.state in ("succeeded", "preempted") and event.delay is not None else ""
        )
        by = f" by {event.answered_by}" if event.answered_by else ""
        lines[event.id] = f"{line} {event.state} {round(event.at.seconds, 6):g}{after}{by},"
    return [line.rstrip(",") for line in lines.values()]
