// Who is let in: the browser that opened the address which friso printed has a key, in what it keeps for this name and
// port alone; a cookie would go to every server of this name, whatever its port.
// A server that is started again at this port lets the page in that proves to know the secret, which is sent to nobody: what
// listens at this port may be another program.
const KEY = "friso-key";
const SECRET = "friso-secret";
const held = {}; // where the browser keeps nothing

function kept(name) {
  try {
    return held[name] ?? localStorage.getItem(name) ?? "";
  } catch {
    return held[name] ?? "";
  }
}

function keep(name, value) {
  try {
    localStorage.setItem(name, value);
  } catch {
    held[name] = value;
  }
}

/** Ask the server for something, as fetch does, with the key: another tab may have got a newer one. */
export const request = (path, options = {}) => fetch(path, { ...options, headers: { ...options.headers, Authorization: `Bearer ${kept(KEY)}` } });

/** Exchange the token of the address, if it has one, for a key, and take it out of the address. */
export async function enter() {
  const token = new URLSearchParams(location.search).get("token");
  if (token === null) return;
  const response = await request("enter", { method: "POST", headers: { "Friso-Token": encodeURIComponent(token) } });
  history.replaceState(null, "", location.pathname + location.hash);
  if (response.ok) await entered(response); // else a token that was taken: perhaps by this browser, which has its key
}

async function entered(response) {
  const { key, secret } = await response.json();
  keep(KEY, key);
  keep(SECRET, secret);
}

const hex = (bytes) => Array.from(new Uint8Array(bytes), (byte) => byte.toString(16).padStart(2, "0")).join("");

/** Enter a server that was started again at this port; resolves to whether it has let this page in. */
export async function again() {
  const challenge = (await request("enter", { method: "POST" })).headers.get("Friso-Challenge");
  const secret = kept(SECRET);
  if (!challenge || !secret || !crypto.subtle) return false; // a page that comes unencrypted from another machine has none
  const text = new TextEncoder();
  const key = await crypto.subtle.importKey("raw", text.encode(secret), { name: "HMAC", hash: "SHA-256" }, false, ["sign"]);
  const proof = hex(await crypto.subtle.sign("HMAC", key, text.encode(challenge)));
  const response = await request("enter", { method: "POST", headers: { "Friso-Proof": proof } });
  if (response.ok) await entered(response);
  return response.ok;
}

let library = null;

/** Load plotly.js, which the server hands out with the key alone. */
export const plotly = () => (library ??= load());

async function load() {
  const script = document.createElement("script");
  script.src = URL.createObjectURL(await (await request("plotly.js")).blob());
  await new Promise((done, failed) => {
    Object.assign(script, { onload: done, onerror: failed });
    document.head.append(script);
  });
  URL.revokeObjectURL(script.src);
}
