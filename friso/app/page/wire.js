// Questions to the server. A newer question on a lane overtakes the one before it; answers come in frames, see frames.py.
import { token } from "./dom.js";
import { again, enter, plotly, request } from "./entry.js";

const page = token();
const lanes = new Map();
let asked = 0;

/** Ask a question; `part` is called with every part of the answer. Resolves to the last part, or null if overtaken. */
export async function ask(question, body, lane = question, part = () => {}) {
  lanes.get(lane)?.abort();
  const abort = new AbortController();
  lanes.set(lane, abort);
  try {
    const response = await request(`ask/${question}`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ ...body, page, lane, number: ++asked }),
      signal: abort.signal,
    });
    if (!response.ok) return refusal(response);
    let last = null;
    for await (const value of frames(response.body.getReader())) {
      if (abort.signal.aborted) return null;
      last = value;
      part(value);
    }
    const ended = last?.kind === "overtaken"; // not by this page: the server ends
    reached(!ended);
    return ended ? null : last;
  } catch (error) {
    if (abort.signal.aborted) return null;
    reached(false);
    return null;
  } finally {
    if (lanes.get(lane) === abort) {
      lanes.delete(lane);
      idle.forEach((listener) => listener(lane));
    }
  }
}

const idle = [];

/** Be told of a lane on which nothing is at work any more. */
export const onIdle = (listener) => idle.push(listener);

/** End what is asked on a lane. */
export const end = (lane) => lanes.get(lane)?.abort();

async function refusal(response) {
  if (response.status === 403) {
    reached(false, ANEW);
    return null;
  }
  return { kind: "refused", key: "", text: await reason(response) };
}

/** Why the server refused something. */
async function reason(response) {
  return (await response.json().catch(() => ({}))).text ?? `The server answered ${response.status}.`;
}

/** Hand a file to the server; resolves to the name it has there, or throws what is wrong. */
export async function hand(file) {
  const response = await request(`logs/${encodeURIComponent(file.name)}`, { method: "POST", body: file }).catch((error) => {
    reached(false);
    throw error;
  });
  if (response.status === 403) reached(false, ANEW);
  if (!response.ok) throw new Error(await reason(response));
  return (await response.json()).file;
}

/** Have the server delete a file that was handed to it, even while the page is being left; a server that is gone has deleted it. */
export const drop = (name) => request(`logs/${name.split("/").map(encodeURIComponent).join("/")}`, { method: "DELETE", keepalive: true }).catch(() => {});

/** The stage file that the server begins with; null while it cannot be reached. */
export async function first() {
  try {
    await enter();
    const response = await request("begin");
    if (response.ok) return await plotly().then(() => response.json());
    reached(false, response.status === 403 ? ANEW : GONE);
  } catch {
    reached(false);
  }
  return null;
}

/** The values of frames as they come. What has come is joined once a whole frame is there, however many chunks it comes in. */
export async function* frames(reader) {
  let chunks = [];
  let size = 0;
  let needed = 8;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    chunks.push(value);
    size += value.length;
    if (size < needed) continue;
    let held = joined(chunks, size);
    for (needed = 8; held.length >= needed; needed = 8) {
      const sizes = new DataView(held.buffer, held.byteOffset, 8);
      const [text, numbers] = [sizes.getUint32(0, true), sizes.getUint32(4, true)];
      const begin = 8 + text;
      needed = begin + numbers;
      if (held.length < needed) break;
      const json = JSON.parse(new TextDecoder().decode(held.subarray(8, begin)));
      yield unpacked(json, held.slice(begin, needed).buffer);
      held = held.subarray(needed);
    }
    chunks = [held];
    size = held.length;
  }
}

function joined(chunks, size) {
  if (chunks.length === 1) return chunks[0];
  const all = new Uint8Array(size);
  let place = 0;
  for (const chunk of chunks) {
    all.set(chunk, place);
    place += chunk.length;
  }
  return all;
}

function unpacked(value, numbers) {
  if (Array.isArray(value)) return value.map((item) => unpacked(item, numbers));
  if (value === null || typeof value !== "object") return value;
  if (Array.isArray(value.shape)) { // that of a hatching is a text
    const [rows, columns] = value.shape;
    if (columns === undefined) return new Float32Array(numbers, value.array, rows);
    return Array.from({ length: rows }, (_, row) => new Float32Array(numbers, value.array + 4 * row * columns, columns));
  }
  return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, unpacked(item, numbers)]));
}

// ---------------------------------------------------------------- whether the server is there

const listeners = [];
let there = true;
const LOOKED = 1000; // [ms]

/** Be told when the server goes and comes back: with whether it is there, and a text. */
export const onReach = (listener) => listeners.push(listener);

const GONE = "The server does not answer. What is on this page is kept; it goes on when the server is back.";
const ANEW = "friso lets in only the browser that has opened the address which it printed when it started: open that address. What is on this page is kept.";

function reached(now, text = GONE) {
  if (now === there && now) return;
  there = now;
  listeners.forEach((listener) => listener(now, text));
}

/** See whether the server is there; one that was started again at this address is entered again. */
async function look() {
  try {
    const { status } = await request("begin", { method: "HEAD" });
    if (status === 403 && !(await again())) return reached(false, ANEW);
    reached(true);
  } catch {
    reached(false);
  } finally {
    setTimeout(look, LOOKED);
  }
}
setTimeout(look, LOOKED);

/**
 * What asks again and again while something is dragged: one question on its way, and the newest one waiting; one that
 * takes longer than `patience` [ms] is overtaken.
 */
export class Live {
  constructor(question, lane, patience, done) {
    Object.assign(this, { question, lane, patience, done, busy: false, next: null, begun: 0, timer: 0 });
  }

  ask(body, tag) {
    this.next = { body, tag };
    const left = this.busy ? this.begun + this.patience - performance.now() : 0;
    if (left <= 0) return this.go();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.go(), left);
  }

  async go() {
    clearTimeout(this.timer);
    const { body, tag } = this.next;
    this.next = null;
    this.busy = true;
    const begun = (this.begun = performance.now());
    const answer = await ask(this.question, body, this.lane, (part) => (part.kind === "message" || part.kind === "partly") && this.done(part, tag));
    if (begun !== this.begun) return;
    this.busy = false;
    if (answer) this.done(answer, tag);
    if (this.next) this.go();
  }

  stop() {
    clearTimeout(this.timer);
    this.next = null;
    end(this.lane);
  }
}
