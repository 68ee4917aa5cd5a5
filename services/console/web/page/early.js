// A page that is loaded anew says at once that it is there again: the rest of it may take longer to come than the window waits.
import { KEPT, linkTo } from "./place.js";

const { session } = JSON.parse(sessionStorage.getItem(KEPT) ?? "{}");
export const early = session ? new WebSocket(linkTo(session)) : null;
