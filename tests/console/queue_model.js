// 1000 orders a run against a model of the window: links that are cut before or after delivery, windows that are started anew.
(async (runs) => {
const { queue } = await import(new URL("page/queue.js", document.baseURI));
let seed = 1; const rnd = () => (seed = (seed * 1103515245 + 12345) % 2147483648) / 2147483648;
let bad = 0, done = 0, rep = 0;
for (let run = 0; run < runs; run += 1) {
  const q = queue(); let life = 1, session = "", taken = 0, open = false, at = 0; const log = []; const reports = []; const given = new Set();
  const say = (r) => reports.push(...r);
  const link = () => { if (!session || rnd() < 0.03) { session = `s${life++}`; taken = 0; } open = true; say(q.open(session, taken)); };
  for (let n = 0; n < 1000; n += 1) {
    at += rnd() * 0.5;
    if (!open && rnd() < 0.3) link();
    say(q.expire(at));
    const kind = rnd();
    const order = kind < 0.1 ? { do: "steer", to: "stop", id: n } : kind < 0.4 ? { do: "tell", text: `w${n}.` } : { do: "type", text: `w${n}.` };
    if (order.id !== undefined) given.add(n);
    say(q.give(order, at));
    if (open) {
      const messages = q.next({ frame: at, heard: at });
      const arrive = rnd() < 0.1 ? Math.floor(rnd() * (messages.length + 1)) : messages.length;
      messages.slice(0, arrive).forEach((m) => { const g = JSON.parse(m); if (g.number === taken + 1) { taken += 1; log.push(g.order); } else bad += 1; });
      if (arrive < messages.length || rnd() < 0.1) open = false; else q.taken(taken);
    }
  }
  link(); q.next({ frame: at, heard: at }).forEach((m) => { const g = JSON.parse(m); if (g.number === taken + 1) { taken += 1; log.push(g.order); } else bad += 1; }); q.taken(taken);
  const text = reports.map((r) => r.text).join("\n");
  const seen = new Map(); for (const o of log) { const key = o.text ?? `stop${o.id}`; seen.set(key, (seen.get(key) ?? 0) + 1); }
  for (const c of seen.values()) if (c > 1) bad += 1;
  const lines = reports.map((r) => r.text);
  let stops = 0;
  for (let n = 0; n < 1000; n += 1) {
    const isDone = seen.has(`w${n}.`), isReported = text.includes(`“w${n}.”`), isSure = lines.some((l) => l.startsWith("Not done") && l.includes(`“w${n}.”`));
    if (given.has(n)) { stops += seen.has(`stop${n}`); continue; }
    if (!isDone && !isReported && !given.has(n)) bad += 1;
    if (isDone && isSure) bad += 1;
  }
  for (const kind of ["tell", "type"]) { const ns = log.filter((o) => o.do === kind).map((o) => Number(o.text.slice(1, -1))); if (ns.some((v, i) => i && v < ns[i - 1])) bad += 1; }
  if (stops + lines.filter((l) => l.startsWith("Nobody knows") && l.includes(": Stop.")).length < given.size) bad += 1;
  done += log.length; rep += reports.filter((r) => !r.text.startsWith("The window has begun")).length;
}
return { bad, done, reported: rep };
})