// What becomes of somebody who does nothing, by the seconds since they last did something. Pure.
export const TIP = 12; // seconds until a tip, and between two
export const ASK = 45; // seconds until a kiosk asks whether somebody is still there
export const LEAVE = 60; // seconds until it begins anew

// seated: they have a seat. Returns what to do: nothing, `tip` with its number, `ask` with the seconds that are left, `anew`.
export function visit(idle, { seated, kiosk, touched }) {
  if (kiosk && (seated || touched)) {
    if (idle >= LEAVE) return { do: "anew" };
    if (seated && idle >= ASK) return { do: "ask", left: Math.ceil(LEAVE - idle) };
  }
  if (seated && idle >= TIP) return { do: "tip", number: Math.floor(idle / TIP) - 1 };
  return { do: "nothing" };
}

// How somebody takes part: the name of a text, and how much, 0 to 1. The level is of what goes on with the robot itself; who looks at what lies before both
// of them is at their task, whatever the level falls to, and not elsewhere.
export function part(talk, scene, id) {
  const { level = "unknown", value = 0 } = talk?.levels.find(({ actor }) => actor === id) ?? {};
  const looks = scene?.people.find((each) => each.id === id)?.looks ?? [];
  const isAtTask = looks.some((one) => scene.things.some((each) => each.id === one && each.kind !== "hand"));
  return { level: isAtTask && ["disengaging", "disengaged"].includes(level) ? "occupied" : level, value };
}

// What goes on between the robot and a person, in the order of what they should know first: the name of a text, and a thing that it is about.
export function moment(talk, robot, you) {
  const bonds = talk.bonds.filter(({ by, to }) => (by === robot && to === you) || (by === you && to === robot));
  const says = talk.voices.find(({ actor, to }) => actor === robot && to.length)?.to ?? [];
  const isInTurn = talk.bubbles.some(({ actor, open }) => actor === robot && open); // silent for a moment, and it goes on
  const waits = (kind) => bonds.find((each) => each.kind === kind && each.by === robot && !each.met);
  if (says.includes(you)) {
    const look = waits("directed_gaze");
    return look ? { text: "about", about: look.about[0] } : { text: "listen" };
  }
  if (says.length) return { text: "elsewhere", about: says[0] };
  if (waits("adjacency_pair")) return { text: isInTurn ? "listen" : "looking" };
  if (waits("directed_gaze")) return { text: "about", about: waits("directed_gaze").about[0] };
  if (bonds.some((each) => each.kind === "mutual_facial_gaze" && each.met)) return { text: "mutual" };
  return waits("mutual_facial_gaze") ? { text: "meet" } : null;
}
