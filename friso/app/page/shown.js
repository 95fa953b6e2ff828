// The machine shown, and which version of it what stands on the page is of: what is of another one does nothing and says so.
import { plain } from "./dom.js";
import * as machines from "./state.js";

/** How long [ms] what is of an earlier version of this machine stands in colour: what is newer mostly comes before. */
const OLD_AFTER = 300;

let latest = null;
let timer = 0;

/** The machine shown as it is set now, one object until that changes: its name, text and file (`machine`), the keys `given`, what is
 * `sent` of it, what the server made of it (`described`; `read` waits for that), the `answers` about it, by tab, and whether its check
 * has ended (`concluded`). */
export function now() {
  const machine = machines.current();
  const given = machines.changes();
  const pinned = machines.pinned();
  const key = JSON.stringify(given);
  if (latest?.machine !== machine || latest.key !== key || latest.pinned !== pinned) {
    let settle;
    const read = new Promise((resolve) => (settle = resolve));
    latest = { machine, given, key, pinned, sent: machines.sent(), described: null, read, settle, answers: new Map(), concluded: false };
  }
  return latest;
}

const isOfMachine = ({ machine }) => machine === machines.current();

/** Whether a version is the machine as it is set now; after an undo it may be again. */
export const isNow = (version, free = []) => isOfMachine(version) && same(version, now(), free) && version.pinned === now().pinned;

/** Whether two versions of a machine have the same keys, whatever those in `free` are. */
export const same = (one, other, free) => one.key === other.key || (free.length > 0 && Object.keys({ ...one.given, ...other.given }).every((path) => free.includes(path) || one.given[path] === other.given[path]));

/** What an element is: an answer is of one version; parts in a drawing are chosen, and fields show what is set, of any version of a machine. */
export const [ANSWER, DRAWING, FIELDS] = [0, 1, 2];

/** Note what an element shows of a version, whatever the keys in `free` are. */
export function mark(element, version, kind = ANSWER, free = []) {
  Object.assign(element, { version, kind, free, late: 0 });
  element.dataset.of = "";
  look();
}

/** Have all that is of another version do nothing and, unless something newer comes soon, say so; what is of another machine is not seen. */
export function look() {
  clearTimeout(timer);
  if (!machines.current()) return;
  const moment = performance.now();
  let next = Infinity;
  for (const element of document.querySelectorAll("[data-of]")) {
    const { version, kind, free } = element;
    const current = isNow(version, free);
    const other = !isOfMachine(version);
    element.inert = other || (kind === ANSWER && !current);
    if (current || kind === FIELDS) element.late = 0;
    else element.late ||= moment + OLD_AFTER;
    element.classList.toggle("other", other);
    const old = !other && element.late > 0 && element.late <= moment;
    element.classList.toggle("old", old);
    if (!old && element.late) next = Math.min(next, element.late);
  }
  for (const line of document.querySelectorAll(".older")) {
    const old = line.parentElement.querySelector("[data-of].old");
    const text = old ? plain(`In grey: ${older(old.version)}`) : "";
    if (line.textContent !== text) line.textContent = text;
  }
  if (next < Infinity) timer = setTimeout(look, next - moment);
}

/** Of a version that is not the one set now: of which machine, and what set it apart. */
function older({ machine, given }) {
  const name = machine.name.replace(/\.toml$/, "");
  const apart = difference(machines.changes(), given);
  return apart ? `of ${name} with ${apart}, not as it is set now.` : `of ${name}, but of another machine pinned, or of none.`;
}

/** What sets the keys `given` apart from those before. */
export function difference(before, given) {
  const paths = [...new Set([...Object.keys(before), ...Object.keys(given)])].filter((path) => before[path] !== given[path]);
  return paths.map((path) => `${path} ${path in given ? given[path] ?? "removed" : "as opened"}`).join(", ");
}
