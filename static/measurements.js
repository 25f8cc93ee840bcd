// What accuracy costs on this machine: the calibration as a plot and as a table, and a button that measures it.

import { make, short } from "./dom.js";
import { drawPlot, finding, METHODS, sign } from "./plot.js";

const ADDRESS = "/v1/calibration";
const NOT_YET = "urn:dlo:problem:not-calibrated";
const note = document.getElementById("plot-note");
const figure = document.getElementById("plot-figure");
const box = document.getElementById("plot");
const legend = document.getElementById("plot-legend");
const table = document.getElementById("plot-table");
const measuring = document.getElementById("measure");
const [button, bar, said] = ["button", "progress", "span"].map((part) => measuring.querySelector(part));
let points = [];
let drawn = null; // the motions that the plot shows
let plot = null;
let pointed = -1;

function words(point) {
  const failed = point.converged === false ? ", did not converge" : "";
  const what = point.label ? `${point.label}, with error estimate` : `${point.method}, ${point.n_u} × ${point.n_t}`;
  return `${what}: ${short(point.x)} ms, ${short(point.y)} mm${failed}`;
}

function show(index) {
  pointed = index;
  if (index < 0) {
    plot.leave();
    return;
  }
  plot.point(index);
  box.setAttribute("aria-valuenow", index + 1);
  box.setAttribute("aria-valuetext", words(points[index]) + (points[index].best ? ", the best for its time" : ""));
}

function draw() {
  plot = drawPlot(box, points, words);
  if (pointed >= 0) show(Math.min(pointed, points.length - 1));
}

function step(event) {
  const last = points.length - 1;
  const next = { ArrowRight: pointed + 1, ArrowUp: pointed + 1, ArrowLeft: pointed - 1, ArrowDown: pointed - 1, Home: 0, End: last }[event.key];
  if (event.key === "Escape") show(-1);
  if (next === undefined) return;
  event.preventDefault();
  show(Math.min(Math.max(next, 0), last));
}

function entry(method) {
  const swatch = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  swatch.setAttribute("viewBox", "-8 -8 16 16");
  swatch.setAttribute("aria-hidden", "true");
  swatch.append(sign(method, 0, 0, 5));
  return make("li", {}, swatch, method === "auto" ? "default quality, with error estimate" : method);
}

function row(point) {
  const cells = [point.method, point.n_u, point.n_t].map((value) => make("td", {}, String(value)));
  const numbers = [point.x, point.y].map((value) => make("td", { className: "number" }, short(value)));
  return make("tr", {}, ...cells, ...numbers, make("td", {}, point.best ? "yes" : ""));
}

function present(calibration) {
  const best = new Set(calibration.front);
  const own = calibration.default ? [{ ...calibration.default, label: "default quality" }] : [];
  points = [...calibration.points.map((point, index) => ({ ...point, best: best.has(index) })), ...own]
    .map((point) => ({ ...point, x: point.wall_time * 1e3, y: point.error * 1e3 }))
    .filter((point) => point.x > 0 && point.y > 0)
    .sort((one, other) => one.x - other.x);
  if (points.length === 0) return;
  figure.hidden = false;
  button.textContent = "Measure again";
  document.getElementById("plot-finding").textContent = finding(points);
  const machine = Object.entries(calibration.machine).map(([name, value]) => `${name} ${value}`).join(", ");
  const measured = new Date(calibration.measured_at).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
  const stale = calibration.current === false ? "The machine or the program has changed since then. " : "";
  document.getElementById("plot-machine").textContent = `Measured ${measured}: ${machine}. ${stale}`;
  legend.replaceChildren(...METHODS.filter((method) => points.some((point) => point.method === method)).map(entry),
    make("li", { className: "best" }, "the best for its time"));
  table.querySelector("tbody").replaceChildren(...points.map(row));
  box.setAttribute("aria-valuemax", points.length);
  draw();
}

function tellHow() {
  note.hidden = points.length > 0;
  note.replaceChildren("This machine has not been measured yet. Measure it with ", make("code", {}, "dlo calibrate"), ".");
}

async function load() {
  const chosen = figure.querySelector("input:checked");
  try {
    const health = await (await fetch("/health")).json(); // a request for measurements that don't exist would log an error
    if (health.calibrated === false) {
      measuring.hidden = false;
      tellHow();
      return;
    }
    const answer = await fetch(`${ADDRESS}?dimensions=${chosen.value}`, { headers: { Accept: "application/json" } });
    if (!answer.ok && answer.status !== 404) throw new Error(answer.statusText);
    const found = await answer.json();
    measuring.hidden = !answer.ok && found.type !== NOT_YET;
    if (answer.ok) {
      present(found);
      drawn = chosen;
    }
    tellHow();
  } catch {
    if (drawn !== null) drawn.checked = true;
    note.hidden = false;
    note.textContent = "The measurements can't be loaded right now.";
  }
}

/** Measure this machine with a progress bar, and show the result. */
async function measure() {
  button.disabled = true;
  bar.hidden = false;
  bar.value = 0;
  said.textContent = "";
  const finish = (text) => {
    button.disabled = false;
    bar.hidden = true;
    said.textContent = text;
  };
  const failed = "The measurement failed. Try again later.";
  const answer = await fetch(ADDRESS, { method: "POST" }).catch(() => null);
  if (answer === null || !answer.ok) {
    finish(failed);
    return;
  }
  const course = new EventSource(`${ADDRESS}/events`);
  course.addEventListener("progress", (event) => {
    const { done, total, what } = JSON.parse(event.data);
    bar.value = done / total;
    said.textContent = what;
  });
  course.addEventListener("done", () => {
    course.close();
    finish("");
    load();
  });
  course.addEventListener("error", (event) => {
    if (event.data === undefined && course.readyState !== EventSource.CLOSED) return; // it reconnects by itself
    course.close();
    finish(failed);
  });
}

export function showMeasurements() {
  box.addEventListener("keydown", step);
  box.addEventListener("focus", () => { if (pointed < 0) show(0); });
  box.addEventListener("blur", () => show(-1));
  box.addEventListener("pointermove", (event) => show(plot.meant(event)));
  box.addEventListener("pointerdown", (event) => show(plot.meant(event)));
  box.addEventListener("pointerleave", () => show(-1));
  new ResizeObserver(() => { if (points.length > 0 && box.clientWidth > 0) draw(); }).observe(figure);
  figure.addEventListener("change", load);
  button.addEventListener("click", measure);
  window.addEventListener("focus", () => { if (points.length === 0) load(); }); // it may have been measured meanwhile
  load();
}
