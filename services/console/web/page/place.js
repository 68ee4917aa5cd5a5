// Where a page's link goes, and where the page keeps its session while it is loaded anew.
export const KEPT = `engage-session ${location.pathname}`; // another path is another robot

// Address of the link of a session; empty: a new one.
export function linkTo(session) {
  const place = new URL(document.body.dataset.link, document.baseURI);
  place.protocol = place.protocol.replace("http", "ws");
  place.searchParams.set("session", session);
  return place;
}
