// Where the panels stand: each may be moved, put away and made wide, and this browser keeps it so.
import { element } from "./look.js";

const KEPT = "engage-panels";
const COLUMNS = ["wide", "main", "side"];
const AWAY = "put-away"; // no `hidden`: a recording hides panels, too

// root: the window, with its columns and the list of panels.
export function desk(root) {
  const columns = COLUMNS.map((name) => root.querySelector(`.column.${name}`));
  const [wide] = columns;
  const panels = [...root.querySelectorAll(".column > section")];
  const home = new Map(panels.map((panel) => [panel, panel.parentElement]));
  const rows = element("ul", {});
  const told = element("p", { role: "status", class: "why" });
  const again = element("button", { type: "button" }, "As at first");

  // Ids of the panels of each column, in their order, each with whether it is there.
  const layout = () => columns.map((column) => [...column.children].map(({ id, classList }) => [id, !classList.contains(AWAY)]));
  function arrange(wanted) {
    wanted.forEach((ids, index) => {
      for (const [id, isThere] of ids) {
        const panel = panels.find((each) => each.id === id);
        if (!panel) continue; // kept by another version of this page
        columns[index].append(panel);
        panel.classList.toggle(AWAY, !isThere);
      }
    });
    show();
  }
  const shows = [];
  let first = null; // the layout of the page as it came
  function show() {
    root.classList.toggle("arranged", first !== null && JSON.stringify(layout()) !== JSON.stringify(first));
    for (const each of shows) each();
  }
  function keep(news) {
    show();
    told.textContent = news;
    try {
      localStorage.setItem(KEPT, JSON.stringify(layout()));
    } catch {
      told.textContent = `${news} This browser does not keep it.`;
    }
  }

  for (const panel of panels) {
    const title = panel.querySelector("h2").textContent;
    const box = element("input", { type: "checkbox" });
    const button = (text, name, act) => {
      const made = element("button", { type: "button", "aria-label": `${title}: ${name}`, title: name }, text);
      made.addEventListener("click", act);
      return made;
    };
    const place = () => {
      const all = [...panel.parentElement.children];
      return `${title} is number ${all.indexOf(panel) + 1} of ${all.length}.`;
    };
    box.addEventListener("change", () => {
      panel.classList.toggle(AWAY, !box.checked);
      keep(`${title} is ${box.checked ? "there" : "put away"}.`);
    });
    const earlier = button("↑", "earlier", () => {
      panel.previousElementSibling?.before(panel);
      keep(place());
    });
    const later = button("↓", "later", () => {
      panel.nextElementSibling?.after(panel);
      keep(place());
    });
    const large = button("wide", "over the whole width", () => {
      const isWide = panel.parentElement === wide;
      (isWide ? home.get(panel) : wide).append(panel);
      keep(`${title} is ${isWide ? "as wide as at first" : "over the whole width"}.`);
    });
    shows.push(() => {
      box.checked = !panel.classList.contains(AWAY);
      large.setAttribute("aria-pressed", String(panel.parentElement === wide));
    });
    rows.append(element("li", {}, element("label", {}, box, ` ${title}`), earlier, later, large));
  }

  first = layout();
  again.addEventListener("click", () => {
    arrange(first);
    keep("All panels are as at first.");
  });
  root.querySelector(".desk").append(rows, again, told);
  try {
    arrange(JSON.parse(localStorage.getItem(KEPT)) ?? first);
  } catch {
    arrange(first); // it is none of ours, or the browser keeps nothing
  }
}
