// What pictures show, in words, for those who cannot see them.
const EACH = 2000; // ms between two descriptions of one picture: a screen reader cannot follow more

// A function that says at most every two seconds what is going on.
export function described(element, words) {
  let at = -EACH;
  return (state) => {
    if (performance.now() - at < EACH) return;
    at = performance.now();
    element.setAttribute("aria-label", words(state));
  };
}

export const list = (ids, last = "and") => (ids.length > 1 ? `${ids.slice(0, -1).join(", ")} ${last} ${ids.at(-1)}` : ids[0]);

// A sentence for each who is there: "ann looks at robot, points at blue square, speaks."
export function sceneInWords({ scene }) {
  const { body, things, people, robot } = scene;
  const labels = new Map(things.map((each) => [each.id, each.label || each.id]));
  const named = (ids, last) => list(ids.map((id) => labels.get(id) ?? id), last);
  const sentence = (who, does) => `${who} ${does.filter(Boolean).join(", ") || "is there"}.`;
  const told = people.filter((each) => each.present).map((each) => sentence(each.id, [
    each.looks?.length ? `looks at ${named(each.looks, each.one_of ? "or" : "and")}` : each.looks ? "looks away" : "",
    each.points.length ? `points at ${named(each.points)}` : "",
    each.acts.length ? `moves ${named(each.acts)}` : "",
    each.nods ? `${each.nods}s` : "",
    each.speaks ? "speaks" : "",
  ]));
  if (body) {
    told.unshift(sentence(robot, [
      body.looks_at ? `looks at ${named([body.looks_at])}` : "",
      body.points.length ? `points at ${named(body.points)}` : "",
      body.speaking ? "speaks" : "",
    ]));
  }
  const pieces = things.filter((each) => each.kind === "object").length;
  return [...told, people.some((each) => each.present) ? "" : "Nobody is there.", `${pieces} objects.`].filter(Boolean).join(" ");
}
