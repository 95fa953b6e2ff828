// Who is let in: the browser that opened the address which friso printed has a key, in what it keeps for this name and
// port alone; a cookie would go to every server of this name, whatever its port.
const KEY = "friso-key";
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

/** Exchange the token of the address, if it has one, for a key, and take it out of the address. */
export async function enter() {
  const token = new URLSearchParams(location.search).get("token");
  if (token === null) return;
  const response = await request("enter", { method: "POST", headers: { "Friso-Token": encodeURIComponent(token) } });
  history.replaceState(null, "", location.pathname + location.hash);
  if (!response.ok) return; // a token that was taken: perhaps by this browser, which has its key
  const given = (await response.json()).key;
  try {
    localStorage.setItem(KEY, given);
  } catch {
    held = given;
  }
}
