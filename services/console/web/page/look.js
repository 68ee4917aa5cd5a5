// Colours and sizes that several pictures share, and how times are written. Colours of the theme are read from the style sheet.
// Kinds of connection events, as the server knows them: kind, name, whether it is answered, colour, and the mark that
// tells them apart where there is only a dot.
const SHADES = [["--gaze", "●"], ["--mutual", "■"], ["--pair", "▲"], ["--back", "◆"], ["--point", "★"], ["--quiet", "✚"]];
export const KINDS = JSON.parse(document.body.dataset.kinds).map((each, index) => [...each, ...SHADES[index % SHADES.length]]);

const PIECES = {
  blue: "#3f6fd1", green: "#3f9d55", purple: "#8a54b8", pink: "#e389b5", white: "#f4f2ea", yellow: "#e9c53c",
  red: "#cf4436", orange: "#e58a2e", black: "#333333", brown: "#8a5a35", gray: "#8d8d8d", grey: "#8d8d8d",
};
export const pieceColor = (color) => PIECES[color] ?? "#9aa5ad";

let read = null;
let theme = null;
export function color(name) {
  const now = document.body.classList.contains("body--dark");
  if (now !== theme) {
    theme = now;
    read = {};
  }
  return (read[name] ??= getComputedStyle(document.querySelector(".window")).getPropertyValue(name).trim());
}
export const isDark = () => document.body.classList.contains("body--dark");

export const seconds = (value) => `${value.toFixed(2)} s`;
export function clock(value) {
  const all = Math.max(0, value);
  return `${Math.floor(all / 60)}:${(all % 60).toFixed(1).padStart(4, "0")}`;
}

// Canvas of the size that its element has on this screen. Returns the context in CSS pixels, and its size.
export function sized(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const scale = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value !== undefined && value !== null && value !== false) made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children);
  return made;
}

export function drawn(name, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

// A text whose commands stand between backticks, as what can be shown.
export function prose(text) {
  return text.split("`").map((part, index) => (index % 2 ? element("code", {}, part) : part));
}

// News of the orders that were given in a panel: shown for a while in its line for them.
export function news(panel) {
  const line = panel.querySelector(".told");
  let shown = [];
  const show = () => line.replaceChildren(...prose(shown.join(" ")));
  return (told) => {
    const texts = told.filter((each) => each.panel === panel.id).map((each) => each.text);
    if (!texts.length) return;
    shown.push(...texts);
    show();
    setTimeout(() => {
      shown = shown.slice(texts.length);
      show();
    }, 9000);
  };
}
