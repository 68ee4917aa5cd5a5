// Buttons that cannot work now: each is disabled, says why, and does nothing. It keeps the focus, so that one can read why.
export function gate(panel, tell) {
  const stop = (event) => {
    const button = event.type === "submit" ? event.submitter ?? event.target.querySelector("[type=submit]") : event.target.closest?.("button");
    if (!button?.dataset.why) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    tell(`${button.textContent.trim()} cannot work now: ${button.dataset.why}.`);
  };
  for (const kind of ["click", "submit", "pointerdown"]) panel.addEventListener(kind, stop, true);
  // why: the reason, in words; empty: the button works.
  return (button, why) => {
    if ((button.dataset.why ?? "") === why) return;
    button.dataset.why = why;
    button.title = why;
    why ? button.setAttribute("aria-disabled", "true") : button.removeAttribute("aria-disabled");
    why ? button.setAttribute("aria-description", why) : button.removeAttribute("aria-description");
  };
}
