// The page: where its panels stand, and its colours. What the panels show is drawn by the other modules, from frames.
import { desk } from "./desk.js";
import { begin } from "./main.js";

const what = (text) => `<p class="what">${text}</p>`; // what a panel shows, for whoever sees it for the first time
const MAIN = [
  ["scene", "Scene", `<div class="space" role="img" aria-label="The scene in 3D"></div>
    <div class="views" role="group" aria-label="Where you look from"></div>`],
  ["above", "From above", `<svg class="map" role="group" aria-label="The table from above"></svg>`],
  ["floor", "Who speaks, and to whom", `${what("Each speech of robot and people, with those it is for, and how engaged each person is.")}<canvas role="img" tabindex="0"></canvas><p class="legend"></p>`],
  ["events", "Connection events", `${what("Moments in which robot and people connect: a look that the other follows, eyes that meet, a turn that is answered, a nod while listening.")}<canvas role="img" tabindex="0"></canvas><p class="legend"></p>`],
  ["behaviors", "Behaviors: planned and measured", `${what("What the body was to do, and below it what it did.")}<canvas role="img" tabindex="0"></canvas><p class="legend"></p>`],
  ["net", "Petri net", `${what("The plan of what the robot says and does now. A token moves on when all that its instant waits for has happened.")}<div class="choose" role="group" aria-label="Which block"></div><div class="net" tabindex="0" role="group" aria-labelledby="net-title"></div><p class="legend"></p>`],
  ["references", "References", `${what("Each time the robot named a thing: open it to see why it looked or pointed, and why in these words.")}<div class="references"></div>`],
  ["notes", "Warnings and news", `<ul class="notes" role="log" aria-live="polite" aria-labelledby="notes-title" tabindex="0"></ul>`],
];
const SIDE = [
  ["part", "You", `<div class="part"></div><div class="microphone row"></div><div class="camera row"></div><p class="told" role="status"></p>`],
  ["said", "Words", `<div class="sound row"></div><ol class="words" aria-labelledby="said-title" tabindex="0"></ol><div class="unseen" role="log" aria-label="What was said just now"></div>`],
  ["wizard", "The robot by hand", `<div class="wizard"></div><p class="told" role="status"></p>`],
  ["head", "Where the robot looks, and why", `<div class="head"></div>`],
  ["measures", "Engagement", `${what("How much each person takes part, by the connection events of late.")}<canvas role="img" tabindex="0"></canvas><p class="legend"></p><p class="reasons"></p>`],
  ["health", "Services", `<ul class="health"></ul>`],
];

const panels = (all) => all.map(([id, title, inside]) => `<section id="${id}" aria-labelledby="${id}-title">
  <h2 id="${id}-title">${title}</h2>${inside}</section>`).join("\n");

const dark = matchMedia("(prefers-color-scheme: dark)");
const paint = () => document.body.classList.toggle("body--dark", dark.matches);
dark.addEventListener("change", paint);
paint();
document.body.innerHTML = `<div class="window">
    <h1 class="unseen">${document.title.replace(/[&<]/g, (sign) => `&#${sign.charCodeAt()};`)}</h1>
    <p class="away" role="alert" hidden></p>
    <p class="waits" role="status" hidden></p>
    <p class="switched" role="status" hidden></p>
    <div id="player" class="player row" role="group" aria-label="The recording" hidden></div>
    <details class="desk"><summary>Panels</summary></details>
    <div class="column wide"></div>
    <div class="column main">${panels(MAIN)}</div>
    <div class="column side">${panels(SIDE)}</div>
  </div>`;
desk(document.querySelector(".window"));
begin(document.querySelector(".window"), document.body.dataset.robot);
