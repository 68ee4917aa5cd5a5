"""Control between bus and body, pure: requests, time and what the driver tells come in; what is to be done comes out.

    intake = ControlIntake("robot", config, "clock")
    effects = intake.take(input, now)           # a step: one of `ControlStep`
    effects = intake.advance(now)               # whenever `deadline` has been reached

Given the same steps in the same order, at the same instants, the effects are the same. So nothing in here reads a
clock or asks the body (services/runtime/intake.py says why): what the service learns of the body it hands in, and
what the body is to do it reads from the effects.

A body is moved by several hands at once: requesters that extend, hold, abort and die, a driver that tells of its
points and may break, other behaviors that take a part over. All of them change one table, `_live`, one at a time.
What went wrong where each of them decided for itself:

- A behavior had two ends: its driver ended it just as it was given up. Here it ends once, by leaving the table. What
  comes later about it, from the driver or from the clock, finds nothing there and changes nothing.
- A driver that does not hear kept a request alive for ever. So whatever a driver is told to end has a deadline:

      under way ──> told to end (revoked, or its stream is left) ──4 s──> broken off ──0.5 s──> given up
          └────────────────┴───────────────────────────────────────────────────┴──> its stream ends

- The outcome named the wrong cause: an arm was aborted, then taken over, then its driver broke. The table keeps who
  was first to end it, and `_end_of` says in one place what each end is called.
- Nobody knew where the arms were. After a driver that broke or was given up, and after the last behavior of a
  requester that is lost, the body goes home without being asked. A way home whose part a new behavior takes ends as
  `replaced`: that is no fault of the body.
- An arm went on by a plan that nobody watched, or fell as the network was cut for half a second. So the pulse of a
  requester is the lease of its movements (decision 0037). The desk tells here whose requester is not heard: its
  behaviors wait where they can. They go on when it is heard again, and lapse when the lease is over.
"""

from collections.abc import Mapping

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import (
    Action,
    BlockBehavior,
    Head,
    Looks,
    Pointing,
    Speech,
)
from engage_hri.schemas.blocks import BodyHeld, Hold
from engage_hri.schemas.body import (
    AbortBehavior,
    BehaviorAborted,
    BehaviorOutcome,
    Capabilities,
    Estimate,
    GoHome,
    HomeReached,
    PerformBehavior,
    SyncPointArrived,
    SyncPointReached,
    WordSpoken,
)
from engage_hri.schemas.body_faults import BodyFault, BodyFaults, FaultsSwitched, SwitchFaults, flaw, switched
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, OngoingActions
from engage_hri.schemas.recognition import SamePeople
from engage_hri.schemas.requests import Accepted, Cancel, Refused
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import COVERED_FOR, CoveredObjects, World, each_of
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import AbortMode, Arrived, Progress, Reached, Revocation, Spoke
from engage_hri.services.control.contract.refusals import refusal
from engage_hri.services.control.contract.variability import Deviations, is_lost
from engage_hri.services.control.serving import steps
from engage_hri.services.control.serving.live_behavior import LiveBehavior, Status, progress_of
from engage_hri.services.reports.ongoing_actions import OngoingActionTracker
from engage_hri.services.reports.same_people import PeopleNames
from engage_hri.services.requests.serving import HoldRequest
from engage_hri.services.runtime.intake import AnswerRequest, Input, PublishMessage

REVOKED_WITHIN: Seconds = 4.0
"""Seconds after which a behavior that was told to end is broken off; before the realizer gives it up."""
BROKEN_OFF_WITHIN: Seconds = 0.5
"""Seconds after that in which a driver may clear away; then its behavior is given up."""

ActionMessage = ActionBegan | ActionEnded


class ControlIntake:
    """All of control but the lives of its requests, the calls of the driver, and the stream of its measurements."""

    def __init__(self, robot: str, config: ControlConfig, clock: str) -> None:
        """clock: name of the one that `now` is read from."""
        self.world = World(entities=())
        """The world as it is known now."""
        self._robot = robot
        self._clock = clock
        self._config = config
        self._objects = CoveredObjects(COVERED_FOR)
        self._names = PeopleNames()
        self._able = Capabilities(body="", types=(), parts=())
        self._faults: tuple[BodyFault, ...] = ()
        """Faults that the body plays."""
        self._live: dict[str, LiveBehavior] = {}
        """Behaviors under way, by the names of their requests."""
        self._holds: dict[str, Hold] = {}
        """Those that wait because their requester is not heard, the oldest first."""
        self._homeward: dict[str, GoHome] = {}
        """Ways home that were asked for, by the names of their requests."""
        self._has_not_come_home = False
        """A way home has failed, and none of the whole body has come to its end since."""
        self._sent = 0
        """Number of messages about sync points and words."""
        self._actions = ActionReporter(robot, clock)
        self._ongoing = OngoingActionTracker()
        self._now: Seconds = 0.0
        self._outputs: list[steps.Effect] = []

    @property
    def deadline(self) -> Seconds | None:
        times = (live.overdue for live in self._live.values())
        return min((at for at in times if at is not None), default=None)

    def refused(self, behavior: BlockBehavior) -> Estimate | None:
        """Estimate of a behavior that no body is asked about; None: it is to be asked."""
        return refusal(behavior, self._able, self._config.no_point_zones, self.world)

    def advance(self, now: Seconds) -> list[steps.Effect]:
        """Take all steps that are due by now."""
        self._now = now
        for live in [*self._live.values()]:
            if live.overdue is not None and live.overdue <= now:
                self._give_up(live) if live.is_broken_off else self._break_off(live)
        return self._take()

    def take(self, input: Input[steps.ControlStep], now: Seconds) -> list[steps.Effect]:
        """Take a step."""
        self._now = now
        match step := input.message:
            case World():
                self._show(self._objects.see(step, now))
            case SamePeople() if self._names.take(step):
                self._show(self._objects.at(now))
            case steps.RequestHanded():
                self._serve(step)
            case HoldRequest():
                self._hold_unheard(step)
            case steps.ControlBegan():
                self._open(step)
            case steps.BodyTold(request=request, progress=progress) if (live := self._live.get(request)) is not None:
                if isinstance(progress, steps.Nonsense):
                    self._leave(live, f"tells {progress.what}")
                elif wrong := live.told.flaw(progress, now):
                    self._leave(live, f"tells {wrong}")
                else:
                    self._report(live, progress_of(live.request.behavior, progress))
            case steps.StreamEnded(request=request) if (live := self._live.get(request)) is not None:
                self._stream_ended(live, step)
            case steps.AuthorityRevoked(request=request, how=how) if (live := self._live.get(request)) is not None:
                self._note_revoked(live, how)
            case steps.EyesMoved():
                self._look(step)
            case steps.HomeEnded():
                self._home_ended(step)
            case steps.FaultsPlayed():
                self._faults_played(step)
            case steps.BodyComplained(fault=fault):
                self._do(steps.Alert(fault))
        return self._take()

    def _show(self, world: World | None) -> None:
        """Let the body see the world, in which people are found by any of their ids."""
        if world is not None:
            self.world = self._names.by_any_id(world)
            self._do(steps.ShowWorld(self.world))

    def _take(self) -> list[steps.Effect]:
        outputs, self._outputs = self._outputs, []
        return outputs

    def _do(self, *outputs: steps.Effect) -> None:
        self._outputs += outputs

    def _stamp(self, at: Seconds | None = None) -> Stamp:
        return Stamp(self._clock, self._now if at is None else at)

    def _publish(self, key: str, message: Message) -> None:
        self._do(PublishMessage(key, message))

    def _reply(self, answer: Message) -> None:
        self._do(AnswerRequest(answer))

    def _refuse(self, name: str, fault: Fault) -> None:
        self._reply(Refused(id=name, fault=fault))

    # -- requests -----------------------------------------------------------------------------------------------

    def _serve(self, handed: steps.RequestHanded) -> None:
        """Serve a request that is new, or that changes a live one."""
        request = handed.request
        live = self._live.get(request.id)
        match request:
            case PerformBehavior() if live is not None:
                self._extend(live, request)
            case PerformBehavior():
                self._begin(request, handed.asked)
            case AbortBehavior():
                self._abort(request)
            case SwitchFaults():
                self._switch(request)
            case GoHome(id=id, parts=parts):
                self._homeward[id] = request
                self._reply(Accepted(id=id))
                self._do(steps.TakeHome(id, parts, id))
            case Cancel() if live is not None and handed.is_orphaned:
                self._lapse(live, request)
            case Cancel() if live is not None:
                live.stop(request.fault(live.request.behavior.id))
                self._revoke(live)
            case Cancel(id=id) if id in self._homeward and not handed.is_orphaned:
                del self._homeward[id]
                self._do(steps.StopHome(id))
                self._refuse(id, request.fault(id).following("given up on the way home", id))

    def _begin(self, request: PerformBehavior, asked: str) -> None:
        name = request.id
        refused = self.refused(request.behavior)  # before a motor sees it
        if refused is not None and refused.fault is not None:
            self._refuse(name, refused.fault)
            return
        try:
            live = LiveBehavior(request, asked, self._now)
        except ValueError as error:
            self._refuse(name, Fault(reason=str(error), where=request.behavior.id, service="control"))
            return
        self._live[name] = live
        self._do(steps.BeginBehavior(request, live.voiced))
        self._hold_or_go_on(live)

    def _extend(self, live: LiveBehavior, request: PerformBehavior) -> None:
        """Give more authority. A hold comes before it, and its end after: nothing moves on a pace that is over."""
        live.is_held = live.is_held or request.held
        self._hold_or_go_on(live)
        try:
            live.authority.extend(request.through)
        except ValueError as error:
            fault = Fault(reason=str(error), where=live.request.behavior.id, service="control")
            self._publish(keys.fault("control"), fault)
        self._do(steps.GiveAuthority(request.id, live.authority.through, request.pace))
        live.is_held = request.held
        self._hold_or_go_on(live)

    def _abort(self, request: AbortBehavior) -> None:
        """End every live behavior of that name, whichever requester has asked for it."""
        label = f"{request.block}:{request.behavior}"
        meant = [live for live in self._live.values() if live.label == label]
        if not meant:
            self._refuse(request.id, Fault(reason="no such behavior", where=label, service="control"))
            return
        self._reply(Accepted(id=request.id))
        for live in meant:
            where, whose = request.behavior, request.requester
            live.stop(Fault(reason="aborted on request", where=where, cause="cancelled", whose=whose))
            live.aborts.append(request.id)
            self._revoke(live, request.how)

    def _lapse(self, live: LiveBehavior, cancel: Cancel) -> None:
        """End a behavior that has lost its requester. With the last one of that requester the body goes home."""
        live.stop(cancel.fault(live.label), lapses=True)
        self._revoke(live)
        others = (each for each in self._live.values() if each.request.requester == cancel.requester)
        if all(each.authority.revoked for each in others):
            why = cancel.fault("")
            self._do(steps.Alert(replace(why, reason=f"{why.reason}; the body goes home", service="control")))
            self._take_home(f"after {cancel.requester}")

    # -- authority ----------------------------------------------------------------------------------------------

    def _hold_or_go_on(self, live: LiveBehavior) -> None:
        """Hold a behavior that somebody has asked to hold, or whose requester is not heard; else let it go on."""
        if (is_held := live.is_held or live.is_unheard) != live.authority.held:
            if is_held:
                live.authority.hold()
            else:
                live.authority.go_on()
            self._do(steps.HoldBehavior(live.request.id, is_held))

    def _hold_unheard(self, hold: HoldRequest) -> None:
        """Hold a behavior that nobody renews, or let it go on."""
        if (live := self._live.get(hold.name)) is None:
            return
        self._holds.pop(hold.name, None)
        live.is_unheard = hold.until is not None
        if hold.until is not None:
            block, behavior = live.request.block, live.request.behavior.id
            self._holds[hold.name] = Hold(
                block=block, behavior=behavior, since=self._stamp(), until=self._stamp(hold.until), why=hold.why
            )
        self._hold_or_go_on(live)
        self._tell_held()

    def _tell_held(self) -> None:
        self._publish(keys.BODY_HELD, BodyHeld(at=self._stamp(), holds=tuple(self._holds.values())))

    def _revoke(self, live: LiveBehavior, how: AbortMode = "relax") -> None:
        if live.authority.revoked is None:
            self._do(steps.RevokeAuthority(live.request.id, how))
            self._note_revoked(live, how)

    def _note_revoked(self, live: LiveBehavior, how: Revocation) -> None:
        """Take note that a behavior is to end: by a request, or since the body gives its part to another."""
        live.authority.revoke(how)
        if live.overdue is None:
            live.overdue = self._now + REVOKED_WITHIN

    # -- what the driver tells ----------------------------------------------------------------------------------

    def _report(self, live: LiveBehavior, progress: Progress) -> None:
        """Pass on what a driver tells. With the first of it the request is accepted."""
        request = live.request
        if not live.is_accepted:
            live.is_accepted = True
            self._reply(Accepted(id=request.id))
        id, block, behavior, requester = live.id, request.block, request.behavior.id, request.requester
        at = self._stamp(progress.at)
        match progress:
            case Arrived(sync=sync):
                self._tell(
                    SyncPointArrived(id=id, block=block, behavior=behavior, sync=sync, at=at, requester=requester)
                )
            case Reached(sync=sync):
                came = self._stamp(progress.arrived)
                reached = SyncPointReached(
                    id=id, block=block, behavior=behavior, sync=sync, at=at, arrived=came, requester=requester
                )
                self._tell(reached)
                live.passed = sync
                live.status = "done" if sync == "end" else live.status
                self._act(self._actions.reached(request.id, live.label, request.behavior, progress))
            case Spoke(word=word, position=position):
                live.position = position
                self._tell(WordSpoken(block=block, behavior=behavior, word=word, position=position, at=at))

    def _tell(self, message: SyncPointArrived | SyncPointReached | WordSpoken) -> None:
        """Publish a message about a sync point, unless the fault `lost` is on and loses it."""
        self._sent += 1
        on = Deviations(self._config.variability.seed, self._faults)
        if not is_lost(on, self._sent, message.at.seconds):
            self._publish(keys.SYNC_POINT, message)

    def _look(self, moved: steps.EyesMoved) -> None:
        """Publish what the eyes rest on now. A behavior of the head has brought them there, if it tells just then."""
        live = self._live.get(moved.request)
        of_head = live is not None and isinstance(live.request.behavior, Looks)
        self._act(self._actions.looks_at(moved.on, live.label if live is not None and of_head else "", moved.at))

    def _act(self, actions: list[ActionMessage]) -> None:
        """Publish actions of the robot, and what goes on after them."""
        for action in actions:
            self._publish(keys.ROBOT_ACTION, action)
        for state in self._ongoing.feed(actions, self._stamp()):
            self._publish(keys.ROBOT_ONGOING, state)

    # -- ends of behaviors --------------------------------------------------------------------------------------

    def _leave(self, live: LiveBehavior, what: str) -> None:
        """Leave a driver that has told what cannot be. Its stream is closed, which takes it a moment."""
        live.is_broken = True
        live.fault = self._broken(live, what)
        self._do(steps.LeaveStream(live.request.id))
        if live.overdue is None:
            live.overdue = self._now + REVOKED_WITHIN

    def _break_off(self, live: LiveBehavior) -> None:
        """Cut off a driver that has not ended a behavior in time."""
        live.is_broken_off = True
        live.fault = live.fault or self._broken(live, f"goes on {REVOKED_WITHIN:.0f} s after it was told to end it")
        live.overdue = self._now + BROKEN_OFF_WITHIN
        self._do(steps.LeaveStream(live.request.id, is_cut_off=True))

    def _give_up(self, live: LiveBehavior) -> None:
        """End a behavior without its driver, which goes on with it whatever is done."""
        live.status = "failed"
        self._finish(live, self._outcome(live))
        self._take_home(f"after {live.label} was given up")

    def _stream_ended(self, live: LiveBehavior, ended: steps.StreamEnded) -> None:
        """End a behavior as its driver has ended it."""
        if ended.how == "refused" and ended.fault is not None:
            self._finish(live, Refused(id=live.request.id, fault=ended.fault))
            return
        if ended.how == "ended" and not live.is_broken and (missing := live.told.missing()):
            live.is_broken, live.fault = True, self._broken(live, f"tells {missing}")
        is_broken = live.is_broken or ended.how == "broken"
        if is_broken or ended.how == "failed":
            live.status, live.fault = "failed", ended.fault or live.fault
        elif live.status == "aborted":
            live.status, live.fault = self._end_of(live)
        if is_broken:
            self._take_home(f"after {live.label} broke")  # nobody knows where its parts are
        self._finish(live, self._outcome(live))

    def _end_of(self, live: LiveBehavior) -> tuple[Status, Fault | None]:
        """Name the end of a behavior that was ended before its last sync point, and say why."""
        if live.authority.revoked == "taken_over":
            reason, where, by = "another behavior took its part", live.request.behavior.id, live.request.requester
            return "taken_over", Fault(reason=reason, where=where, cause="replaced", whose=by)
        return "lapsed" if live.lapses else "aborted", live.why

    def _broken(self, live: LiveBehavior, what: str) -> Fault:
        return Fault(reason=f"the body {self._able.body} {what}", where=live.label, service="control")

    def _outcome(self, live: LiveBehavior) -> BehaviorOutcome:
        return BehaviorOutcome(
            id=live.request.id, block=live.request.block, behavior=live.request.behavior.id, status=live.status,
            at=self._stamp(), passed=live.passed, spoken=live.spoken, fault=live.fault,
        )  # fmt: skip

    def _finish(self, live: LiveBehavior, answer: Refused | BehaviorOutcome) -> None:
        """Forget a behavior; answer its request, and the abort requests that waited for it and for no other one."""
        name = live.request.id
        del self._live[name]
        if self._holds.pop(name, None) is not None:
            self._tell_held()
        self._act(self._actions.ended(name, self._now))
        self._reply(answer)
        awaited = {id for other in self._live.values() for id in other.aborts}
        for id in live.aborts:
            if id not in awaited:
                self._reply(BehaviorAborted(id=id))

    # -- ways home ----------------------------------------------------------------------------------------------

    def _take_home(self, why: str) -> None:
        """Move the whole body home without a request."""
        self._do(steps.TakeHome("", (), why))

    def _home_ended(self, ended: steps.HomeEnded) -> None:
        request, fault = self._homeward.pop(ended.request, None), ended.fault
        if fault is not None:
            if fault.cause != "replaced" and not ended.is_told:
                self._do(steps.Alert(fault))
                self._has_not_come_home = True
            if request is not None:
                self._refuse(request.id, replace(fault, whose=request.requester) if fault.cause else fault)
            return
        if self._has_not_come_home and not ended.parts:
            self._has_not_come_home = False
            self._do(steps.Reassure("the body is at home"))
        if request is not None:
            self._reply(HomeReached(id=request.id, at=self._stamp()))

    # -- what the body is, and faults that it plays ------------------------------------------------------------------

    def _open(self, begun: steps.ControlBegan) -> None:
        """Take in what the body is, and tell that nothing goes on yet."""
        self._able, self._faults = begun.able, begun.faults
        self._objects = CoveredObjects(begun.covered_for)
        self._tell_held()
        self._tell_faults()
        self._publish(keys.ROBOT_ONGOING, OngoingActions(actor=self._robot, at=self._stamp()))

    def _switch(self, request: SwitchFaults) -> None:
        try:
            for fault in request.on:
                if reason := flaw(fault, self._able):
                    advice = "`engage fault list` tells of all that it can play"
                    raise InputRefused(Fault(reason=reason, where=fault.kind, advice=advice, service="control"))
            faults = switched(self._faults, request)
        except InputRefused as error:
            self._refuse(request.id, error.fault)
        else:
            self._do(steps.PlayFaults(request, faults))

    def _faults_played(self, played: steps.FaultsPlayed) -> None:
        self._faults = played.faults
        if played.fault is not None:
            self._refuse(played.request, played.fault)
            return
        self._reply(Accepted(id=played.request))
        self._tell_faults(played.by)
        self._reply(FaultsSwitched(id=played.request, faults=played.faults))

    def _tell_faults(self, by: str = "") -> None:
        """Publish the faults that are on. by: who has switched them; they stay on when it goes, or is killed."""
        self._publish(keys.BODY_FAULTS, BodyFaults(at=self._stamp(), faults=self._faults, by=by))


_HEADS: Mapping[str, Action] = {"NOD": "nod", "SHAKE": "shake"}
"""Heads that mean something as an action; others only turn or tilt."""


class ActionReporter:
    """Actions of `actor` that people see, from the sync points its body reports and what its eyes rest on.

    Each action that began ends once.
    """

    def __init__(self, actor: str, clock: str) -> None:
        self._actor = actor
        self._clock = clock
        self._look: ActionBegan | None = None
        self._open: dict[str, ActionBegan] = {}

    def reached(self, id: str, label: str, behavior: BlockBehavior, reached: Reached) -> list[ActionMessage]:
        """List the actions that begin or end as request `id` passes a sync point. label: `block:behavior`."""
        action: Action
        targets: tuple[str, ...]
        match behavior:
            case Pointing(target=target):
                action, targets, first, last = "point", each_of(target), "stroke_start", "stroke_end"
            case Head(lexeme=lexeme) if (known := _HEADS.get(lexeme.upper())) is not None:
                action, targets, first, last = known, (), "stroke_start", "stroke_end"
            case Speech():
                action, targets, first, last = "speak", (), "start", "end"
            case _:
                return []
        if reached.sync == first:
            self._open[id] = began = self._began(action, targets, label, reached.at)
            return [began]
        return self.ended(id, reached.at) if reached.sync == last else []

    def ended(self, id: str, at: Seconds) -> list[ActionMessage]:
        """End the action of request `id`, if one is open. Call it however the request has ended."""
        return [self._end(began, at)] if (began := self._open.pop(id, None)) else []

    def looks_at(self, entity: str, label: str, at: Seconds) -> list[ActionMessage]:
        """List the looks that end and begin as the eyes come to rest on `entity`; empty: on nothing.

        label: `block:behavior` that brought the eyes there; empty: unknown.
        """
        targets = each_of(entity) if entity else ()
        if targets == (self._look.targets if self._look else ()):
            return []
        messages: list[ActionMessage] = [self._end(self._look, at)] if self._look else []
        self._look = self._began("look", targets, label, at) if targets else None
        return [*messages, self._look] if self._look else messages

    def _began(self, action: Action, targets: tuple[str, ...], label: str, at: Seconds) -> ActionBegan:
        stamp = Stamp(self._clock, at)
        return ActionBegan(actor=self._actor, action=action, at=stamp, targets=targets, behavior=label)

    def _end(self, began: ActionBegan, at: Seconds) -> ActionEnded:
        return ActionEnded(
            actor=began.actor, action=began.action, at=Stamp(self._clock, at), targets=began.targets,
            behavior=began.behavior,
        )  # fmt: skip
