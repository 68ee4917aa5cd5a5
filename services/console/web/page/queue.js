// Orders of this page that the window has not said to have taken. Pure: times are arguments, in seconds of the page's clock.
// Each order ends in one of two ways: the window takes it, once and in the order of numbers, or a report says that it was not done.
const LATE = 5; // seconds after which an act in a conversation would surprise
const SETTING = 30; // the same of what is as right a little later: to sit down, or a condition
const LONGEST = 16000; // characters of an order

const LIMITS = { sit: SETTING, condition: SETTING, play: Infinity, leave: Infinity };
// What ends something is never too late: a robot is stopped, a voice falls silent, a fault goes.
export function limit({ do: what, to, on, off }) {
  if (to === "stop" || on === false || off) return Infinity;
  return LIMITS[what] ?? LATE;
}
const isStop = (order) => order.do === "steer" && order.to === "stop";
// What the robot would begin, or hold, or go on with: a Stop that is given later makes it void.
const isBegun = (order) => ["tell", "prepared", "backchannel"].includes(order.do) || (order.do === "steer" && !isStop(order));
const SEAT = ["sit", "leave", "look", "point", "head", "move", "speak", "type"];
const panel = ({ do: what }) => (SEAT.includes(what) ? "part" : what === "play" ? "player" : "wizard");

export function named(order) {
  const { do: what, text, target, thing, how, to, on, number, name } = order;
  switch (what) {
    case "steer": return { stop: "Stop", hold: "Hold", continue: "Go on" }[to] ?? what;
    case "tell": return [text && `say “${text}”`, target && `name ${target}`].filter(Boolean).join(" and ");
    case "type": return `say “${text}”`;
    case "look": return target ? `look at ${target}` : "look away";
    case "point": return `point at ${target}`;
    case "move": return `move ${thing}`;
    case "head": case "backchannel": return how ?? "nod";
    case "speak": return on ? "speak" : "stop speaking";
    case "sit": return "take a seat";
    case "prepared": return `fragment ${number + 1} of the script`;
    case "inhibit": return on ? "keep the gaze" : "let the gaze go";
    case "condition": return `condition ${name || "none"}`;
    case "faults": return `fault ${order.fault?.kind} ${order.off ? "off" : "on"}`;
    default: return what;
  }
}

// kept: what this page had as it was loaded anew.
export function queue(kept) {
  let { session = "", number = 0, sent = [], waiting = [] } = kept ?? {};
  let hasBegun = sent.length + waiting.length > 0; // else it is no news to a page that its session has ended while it was away
  const report = (order, why) => ({ panel: panel(order), text: `Not done: ${named(order)}. ${why}` });

  // Put Stop in front of all that has not left; what the robot was to do before it is void.
  function stopFirst() {
    const last = waiting.findLastIndex(({ order }) => isStop(order));
    if (last < 0) return [];
    const before = waiting.slice(0, last);
    const isVoid = ({ order }) => isBegun(order);
    waiting = [...waiting.slice(0, last + 1).filter(({ order }) => isStop(order)), ...before.filter((each) => !isStop(each.order) && !isVoid(each)), ...waiting.slice(last + 1)];
    return before.filter(isVoid).map(({ order }) => report(order, "Stop was ordered after it."));
  }

  return {
    give(order, at) {
      if (JSON.stringify(order).length > LONGEST) return [report(order, "It is too long.")];
      waiting.push({ order, at });
      return stopFirst();
    },
    // What has waited too long is given up.
    expire(at) {
      const old = waiting.filter((each) => at - each.at > limit(each.order));
      waiting = waiting.filter((each) => !old.includes(each));
      return old.map(({ order }) => report(order, `The window did not answer for ${limit(order)} s; now it would be too late.`));
    },
    // A link is there. its: session that the window has for us. taken: number of the last order that it has taken.
    open(its, taken) {
      const unknown = its === session ? [] : sent;
      const back = its === session ? sent.filter((each) => each.number > taken) : [];
      const isAnew = hasBegun && Boolean(session) && its !== session;
      hasBegun = true;
      [session, number, sent] = [its, taken, []];
      waiting = [...back.map(({ order, at }) => ({ order, at })), ...waiting];
      const reports = [...unknown.map(({ order }) => ({ panel: panel(order), text: `Nobody knows whether this was done: ${named(order)}. The window was started anew before it answered.` })), ...stopFirst()];
      if (isAnew) for (const each of ["part", "wizard"]) reports.push({ panel: each, text: "The window has begun anew with this page: what you had begun before has ended, your seat too." });
      return reports;
    },
    // What a refusal says, with the name of the order.
    refusal({ refused, text }) {
      const order = sent.find((each) => each.number === refused)?.order;
      return order ? `Not done: ${named(order)}: ${text}` : text;
    },
    taken(last) {
      sent = sent.filter((each) => each.number > last);
    },
    // Messages to send now. frame: seconds of the picture, that were told at `heard` on our clock.
    next({ frame, heard }) {
      const messages = waiting.map(({ order, at }) => {
        number += 1;
        sent.push({ number, order, at });
        const late = limit(order);
        return JSON.stringify({ do: "order", number, until: late === Infinity ? null : frame + at + late - heard, order });
      });
      waiting = [];
      return messages;
    },
    // Names of orders that are without an answer since before `at`.
    pending: (at) => [...sent, ...waiting].filter((each) => each.at < at).map(({ order }) => named(order)),
    kept: () => ({ session, number, sent, waiting }),
    get session() {
      return session;
    },
  };
}
