// Helpers for all parts of the page: elements, numbers, and reading JSON.

export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in element) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** Two significant digits below 10, whole numbers above. */
export function short(value) {
  return String(value >= 10 ? Math.round(value) : Number(value.toPrecision(2)));
}

export function withUnit(value, unit) {
  return value === null || value === undefined ? "–" : `${short(value)} ${unit}`;
}

/** The JSON at an address, or null if there is none (404). */
export async function read(address) {
  const answer = await fetch(address, { headers: { Accept: "application/json" } });
  if (answer.status === 404) return null;
  if (!answer.ok) throw new Error(`${address}: ${answer.status}`);
  return answer.json();
}
