// All words of the stage in each of its languages. What robot and people say stays as they say it.
import { CAMERA_WORDS } from "../page/camera-words.js";
import { SOUND_WORDS } from "../page/sound-words.js";

const ENGLISH = {
  title: "Sit down before the robot and talk with it",
  other: "Deutsch",
  language: "Auf Deutsch",
  robot: "Robot",
  you: "You",
  hello: "Hello!",
  welcome: "Sit down, look, point, talk. The robot looks back.",
  sit: "Sit down and talk",
  sitting: "Sitting down…",
  beside: (names) => (names ? `Sit down beside ${names}` : "Sit down, too"),
  others: (names, count) => `${names || (count > 1 ? "Others" : "Somebody")} ${count > 1 ? "are" : "is"} here already.`,
  visitor: "Visitor",
  hold: "Hold to talk",
  microphone: { off: "Microphone: press to talk", asked: "Microphone: ask no more", on: "Microphone is on: switch it off" },
  camera: { off: "Camera: let the robot see where you look", asked: "Camera: ask no more", on: "Camera is on: switch it off" },
  loud: "The robot's voice",
  talks: "You are talking…",
  type: "Say something",
  within: (language) => ` in ${language}`,
  speaking: (language) => `It speaks ${language}.`,
  send: "Say it",
  sayings: "What you can say",
  quick: [["Hello", "Hello!", null], ["Yes", "Yes.", "nod"], ["No", "No.", "shake"]],
  nod: "Nod",
  point: "Point",
  leave: "Leave",
  scene: "The robot and the people before it, in 3D.",
  pieces: "Things on the table: Enter looks at one, P points at it, the arrows move it.",
  log: "What was said just now",
  levels: { engaged: "is with us", engaging: "is joining", occupied: "is at the table", disengaging: "is drifting away", disengaged: "is elsewhere", unknown: "" },
  mine: { engaged: "are with us", engaging: "are joining", occupied: "are at the table", disengaging: "are drifting away", disengaged: "are elsewhere", unknown: "" },
  speaks: "speaks",
  looking: "The robot waits for your answer.",
  thing: (label) => label,
  about: (thing) => `The robot looks at the ${thing}. Look at it, too: touch it.`,
  mutual: "You look into each other's eyes.",
  meet: "The robot looks at you. Touch its face to look back.",
  listen: "The robot is speaking to you.",
  elsewhere: (name) => `The robot is speaking to ${name}.`,
  // other: words for the language of the robot, where it is not that of the page.
  tips: (ear, eye, other) => [
    ...({
      on: [other ? `Talk${other}: the robot understands nothing else.` : "Just talk: the robot hears you."], off: [`Press the microphone, and talk${other}.`],
      lacking: [`Type what you want to say${other}.`], wordless: [`Type your words${other}: by the microphone the robot only notices that you talk.`],
    }[ear] ?? []),
    ...({ on: ["The robot sees where you look. For a piece, touch it."], off: ["Press the camera, and the robot sees where you look."] }[eye] ?? []),
    "Touch a piece to look at it.", "Drag a piece to move it.", ...(ear === "none" ? ["Hold the round button, and talk."] : []), "Choose Point, and touch a piece.",
  ],
  pointing: "Touch what you point at.",
  moved: "You move it.",
  away: "The robot is getting ready…",
  held: "The robot pauses for a moment.",
  lost: "No link to the robot. Trying again…",
  ended: "The robot was switched off. Ask who looks after it.",
  onlooker: "You look on. To sit down, open the address that the robot's host shows.",
  full: "So many look on that there is no room. Trying again…",
  refused: "That did not work just now. Try again.",
  busy: "One thing after the other: your hand is on its way.",
  gone: "You were away for a moment, and have left the table.",
  still: "Are you still there?",
  ending: (seconds) => `In ${seconds} s it begins anew for the next visitor.`,
  stay: "I am here",
  flat: "This browser shows no 3D. Words and buttons work all the same.",
  sound: { late: "", unheard: () => "The robot does not hear you just now.", plain: "this page came by http, and browsers want https for it. Ask who looks after the robot" },
  seen: { models: "what finds faces is not installed here. Ask who looks after the robot" },
};
const GERMAN = {
  title: "Setz dich vor den Roboter und sprich mit ihm",
  other: "English",
  language: "In English",
  robot: "Roboter",
  you: "Du",
  hello: "Hallo!",
  welcome: "Hinsetzen, hinsehen, zeigen, sprechen. Der Roboter schaut zurück.",
  sit: "Hinsetzen und reden",
  sitting: "Du setzt dich…",
  beside: (names) => (names ? `Neben ${names} setzen` : "Auch hinsetzen"),
  others: (names, count) => `${names || (count > 1 ? "Andere" : "Jemand")} ${count > 1 ? "sind" : "ist"} schon hier.`,
  visitor: "Gast",
  hold: "Halten und sprechen",
  microphone: { off: "Mikrofon: drücken und sprechen", asked: "Mikrofon: nicht mehr fragen", on: "Mikrofon ist an: ausschalten" },
  camera: { off: "Kamera: der Roboter sieht, wohin du schaust", asked: "Kamera: nicht mehr fragen", on: "Kamera ist an: ausschalten" },
  loud: "Die Stimme des Roboters",
  talks: "Du sprichst…",
  type: "Sag etwas",
  within: (language) => ` auf ${language}`,
  speaking: (language) => `Er spricht ${language}.`,
  send: "Sagen",
  sayings: "Was du sagen kannst",
  quick: [["Hallo", "Hallo!", null], ["Ja", "Ja.", "nod"], ["Nein", "Nein.", "shake"]],
  nod: "Nicken",
  point: "Zeigen",
  leave: "Gehen",
  scene: "Der Roboter und die Menschen vor ihm, in 3D.",
  pieces: "Dinge auf dem Tisch: Enter schaut hin, P zeigt darauf, die Pfeile bewegen es.",
  log: "Was eben gesagt wurde",
  levels: { engaged: "ist dabei", engaging: "kommt dazu", occupied: "ist am Tisch", disengaging: "schweift ab", disengaged: "ist woanders", unknown: "" },
  mine: { engaged: "bist dabei", engaging: "kommst dazu", occupied: "bist am Tisch", disengaging: "schweifst ab", disengaged: "bist woanders", unknown: "" },
  speaks: "spricht",
  looking: "Der Roboter wartet auf deine Antwort.",
  thing: (label) => label.split(" ").map((word) => PIECES[word] ?? word).join(" "),
  about: (thing) => `Der Roboter schaut hin: ${thing}. Schau auch hin: berühre es.`,
  mutual: "Ihr schaut euch in die Augen.",
  meet: "Der Roboter schaut dich an. Berühre sein Gesicht, um zurückzuschauen.",
  listen: "Der Roboter spricht mit dir.",
  elsewhere: (name) => `Der Roboter spricht mit ${name}.`,
  tips: (ear, eye, other) => [
    ...({
      on: [other ? `Sprich${other}: der Roboter versteht nichts anderes.` : "Sprich einfach: der Roboter hört dich."], off: [`Drück auf das Mikrofon, und sprich${other}.`],
      lacking: [`Schreib${other}, was du sagen willst.`], wordless: [`Schreib deine Worte${other}: am Mikrofon merkt der Roboter nur, dass du sprichst.`],
    }[ear] ?? []),
    ...({ on: ["Der Roboter sieht, wohin du schaust. Ein Teil berührst du."], off: ["Drück auf die Kamera, und der Roboter sieht, wohin du schaust."] }[eye] ?? []),
    "Berühre ein Teil, um es anzusehen.", "Zieh ein Teil, um es zu bewegen.", ...(ear === "none" ? ["Halte den runden Knopf, und sprich."] : []), "Wähle Zeigen, und berühre ein Teil.",
  ],
  pointing: "Berühre, worauf du zeigst.",
  moved: "Du bewegst es.",
  away: "Der Roboter macht sich bereit…",
  held: "Der Roboter hält einen Moment inne.",
  lost: "Keine Verbindung zum Roboter. Neuer Versuch…",
  ended: "Der Roboter wurde ausgeschaltet. Frag, wer sich um ihn kümmert.",
  onlooker: "Du schaust zu. Zum Hinsetzen öffne die Adresse, die der Gastgeber zeigt.",
  full: "So viele schauen zu, dass kein Platz mehr ist. Neuer Versuch…",
  refused: "Das ging gerade nicht. Versuch es noch einmal.",
  busy: "Eins nach dem anderen: deine Hand ist unterwegs.",
  gone: "Du warst kurz weg und hast den Tisch verlassen.",
  still: "Bist du noch da?",
  ending: (seconds) => `In ${seconds} s beginnt es neu für den nächsten Besuch.`,
  stay: "Ich bin da",
  flat: "Dieser Browser zeigt kein 3D. Worte und Knöpfe gehen trotzdem.",
  sound: { late: "", unheard: () => "Der Roboter hört dich gerade nicht.", plain: "diese Seite kam über http, und Browser wollen dafür https. Frag, wer sich um den Roboter kümmert" },
  seen: { models: "was Gesichter findet, ist hier nicht installiert. Frag, wer sich um den Roboter kümmert" },
};
// Words for pieces, as the world has them; others stay.
const PIECES = {
  orange: "oranges", white: "weißes", blue: "blaues", green: "grünes", purple: "lila", red: "rotes", pink: "rosa", yellow: "gelbes",
  square: "Quadrat", triangle: "Dreieck", rectangle: "Rechteck", trapezoid: "Trapez",
};
const ALL = { en: ENGLISH, de: GERMAN };

const NAMELESS = /^visitor(-\d+)?$/; // ids of who sat down without a name (seats.py), or is only heard (speeches.py)
// The languages that a browser asks for, first the best; English, where there is none of ours.
export function language(wanted) {
  return wanted.map((each) => each.slice(0, 2).toLowerCase()).find((each) => each in ALL) ?? "en";
}
// Of sound and camera a visitor is told in other words what only the robot's host can mend, and nothing of what passes.
// spoken: the language of the robot, as a tag. What is typed at one touch is in that one.
export function texts(name, spoken) {
  const own = ALL[name];
  const called = new Intl.DisplayNames([name], { type: "language" }).of(spoken.split("-")[0]);
  const isOther = spoken.split("-")[0].toLowerCase() !== name;
  const other = isOther ? own.within(called) : "";
  return {
    ...own,
    // How a person is called: by their name, or as somebody who has none.
    called: (id) => (NAMELESS.test(id) ? id.replace("visitor", own.visitor).replace("-", " ") : id),
    // The names of several; empty: not all of them have one.
    listed: (ids) => (ids.some((id) => NAMELESS.test(id)) ? "" : new Intl.ListFormat(name).format(ids)),
    welcome: isOther ? `${own.welcome} ${own.speaking(called)}` : own.welcome,
    type: `${own.type}${other}`,
    tips: (ear, eye) => own.tips(ear, eye, other),
    quick: own.quick.map(([label, , how], index) => [label, ALL[language([spoken])].quick[index][1], how]),
    sound: { ...SOUND_WORDS[name], ...own.sound },
    seen: { ...CAMERA_WORDS[name], plain: own.sound.plain, ...own.seen },
  };
}
export const another = (name) => (name === "de" ? "en" : "de");
