// What accuracy costs on this machine: the calibration as a plot, and as a table.

import { make, read, short } from "./dom.js";
import { drawPlot, finding, METHODS, sign } from "./plot.js";

const PERIOD = 30_000; // ms
const note = document.getElementById("plot-note");
const figure = document.getElementById("plot-figure");
const box = document.getElementById("plot");
const legend = document.getElementById("plot-legend");
const table = document.getElementById("plot-table");
let points = [];
let plot = null;
let pointed = -1;

function words(point) {
  const grid = point.n_u === undefined ? "" : `, ${point.n_u} × ${point.n_t}`;
  const scene = point.scene === undefined ? "" : ` (${point.scene})`;
  return `${point.method}${grid}${scene}: ${short(point.x)} ms, ${short(point.y)} mm`;
}

function show(index) {
  pointed = index;
  if (index < 0) {
    plot.leave();
    return;
  }
  plot.point(index);
  box.setAttribute("aria-valuenow", index + 1);
  box.setAttribute("aria-valuetext", words(points[index]) + (points[index].best ? ", none is better in its time" : ""));
}

function draw() {
  plot = drawPlot(box, points, words);
  if (pointed >= 0) show(pointed);
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
  return make("li", {}, swatch, method);
}

function row(point) {
  const cells = [point.method, point.scene, point.n_u, point.n_t].map((value) => make("td", {}, String(value ?? "–")));
  const numbers = [point.x, point.y].map((value) => make("td", { className: "number" }, short(value)));
  return make("tr", {}, ...cells, ...numbers, make("td", {}, point.best ? "yes" : ""));
}

function present(calibration) {
  const best = new Set(calibration.front);
  points = calibration.points
    .map((point, index) => ({ ...point, x: point.wall_time * 1e3, y: point.error * 1e3, best: best.has(index) }))
    .filter((point) => point.x > 0 && point.y > 0)
    .sort((one, other) => one.x - other.x);
  if (points.length === 0) return;
  figure.hidden = false;
  note.hidden = true;
  document.getElementById("plot-finding").textContent = finding(points);
  const machine = Object.entries(calibration.machine).map(([name, value]) => `${name} ${value}`).join(", ");
  const measured = new Date(calibration.measured_at).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
  document.getElementById("plot-machine").textContent = `Measured ${measured}: ${machine}.`;
  legend.replaceChildren(...METHODS.filter((method) => points.some((point) => point.method === method)).map(entry),
    make("li", { className: "best" }, "the best in its time"));
  table.querySelector("tbody").replaceChildren(...points.map(row));
  box.setAttribute("aria-valuemax", points.length);
  draw();
}

function wire() {
  box.addEventListener("keydown", step);
  box.addEventListener("focus", () => { if (pointed < 0) show(0); });
  box.addEventListener("blur", () => show(-1));
  box.addEventListener("pointermove", (event) => show(plot.meant(event)));
  box.addEventListener("pointerdown", (event) => show(plot.meant(event)));
  box.addEventListener("pointerleave", () => show(-1));
  new ResizeObserver(() => { if (points.length > 0 && box.clientWidth > 0) draw(); }).observe(figure);
}

async function load() {
  if (document.hidden || points.length > 0) return;
  try {
    const calibration = await read("/v1/calibration");
    if (calibration !== null) present(calibration);
    if (points.length === 0) note.replaceChildren("This machine has not been measured yet. Measure it with ", make("code", {}, "dlo calibrate"), "; the plot then appears here.");
  } catch {
    note.textContent = "The measurements can't be read just now.";
  }
}

export function showMeasurements() {
  wire();
  load();
  window.setInterval(load, PERIOD); // it may be measured meanwhile
  document.addEventListener("visibilitychange", load);
}
