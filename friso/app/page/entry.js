// Who is let in: the browser that opened the address which friso printed has a key, in what it keeps for this name and
// port alone; a cookie would go to every server of this name, whatever its port.
// A server that is started again at this port lets the page in that proves to know the secret. The page sends it to nobody, and
// the browser keeps it nowhere: what listens at this port may be another program, whose pages read what the browser keeps.
const KEY = "friso-key";
let secret = "";
let held = ""; // where the browser keeps nothing

const key = () => {
  try {
    return held || (localStorage.getItem(KEY) ?? "");
  } catch {
    return held;
  }
};

/** Ask the server for something, as fetch does, with the key: another tab may have got a newer one. */
export const request = (path, options = {}) => fetch(path, { ...options, headers: { ...options.headers, Authorization: `Bearer ${key()}` } });

/** Enter with the token of the address, which is taken out of it, or with the key that the browser has. */
export async function enter() {
  const token = new URLSearchParams(location.search).get("token") ?? "";
  const response = await request("enter", { method: "POST", headers: { "Friso-Token": encodeURIComponent(token) } });
  history.replaceState(null, "", location.pathname + location.hash);
  if (response.ok) await entered(response);
}

async function entered(response) {
  const told = await response.json();
  secret = told.secret;
  try {
    localStorage.setItem(KEY, told.key);
  } catch {
    held = told.key;
  }
}

const hex = (bytes) => Array.from(new Uint8Array(bytes), (byte) => byte.toString(16).padStart(2, "0")).join("");

/** Enter a server that was started again at this port; resolves to whether it has let this page in. */
export async function again() {
  const challenge = (await request("enter", { method: "POST" })).headers.get("Friso-Challenge");
  if (!challenge || !secret || !crypto.subtle) return false; // a page that comes unencrypted from another machine has none
  const text = new TextEncoder();
  const signing = await crypto.subtle.importKey("raw", text.encode(secret), { name: "HMAC", hash: "SHA-256" }, false, ["sign"]);
  const proof = hex(await crypto.subtle.sign("HMAC", signing, text.encode(challenge)));
  const response = await request("enter", { method: "POST", headers: { "Friso-Proof": proof } });
  if (response.ok) await entered(response);
  return response.ok;
}

let library = null;

/** Load plotly.js, which the server hands out with the key alone. */
export const plotly = () => (library ??= load().catch((error) => {
  library = null; // for the next time
  throw error;
}));

async function load() {
  const response = await request("plotly.js");
  if (!response.ok) throw new Error(`The server answered ${response.status}.`);
  const script = document.createElement("script");
  script.src = URL.createObjectURL(await response.blob());
  await new Promise((done, failed) => {
    Object.assign(script, { onload: done, onerror: failed });
    document.head.append(script);
  });
  URL.revokeObjectURL(script.src);
}
