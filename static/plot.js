// Error against time, log-log, as an SVG: the measured points, the best of them, and a tip for the selected one.

import { make, short } from "./dom.js";

const SVG = "http://www.w3.org/2000/svg";
const MARGIN = { left: 58, right: 18, top: 16, bottom: 50 };
const REACH = 40; // px: the pointer selects a point within this distance
const SHAPES = ["circle", "square", "diamond"]; // they tell methods apart in addition to the colour
export const METHODS = ["march", "spacetime", "auto"]; // the methods that a calibration measures

function svg(tag, attributes, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

function outline(shape, x, y, r) {
  if (shape === "diamond") return `M${x - 1.3 * r} ${y}l${1.3 * r} ${-1.3 * r}l${1.3 * r} ${1.3 * r}l${-1.3 * r} ${1.3 * r}z`;
  if (shape === "square") return `M${x - r} ${y - r}h${2 * r}v${2 * r}h${-2 * r}z`;
  return `M${x - r} ${y}a${r} ${r} 0 1 1 ${2 * r} 0a${r} ${r} 0 1 1 ${-2 * r} 0z`;
}

/** The symbol of a method, `r` px in radius about (x, y). */
export function sign(method, x, y, r, more = "") {
  const shape = SHAPES[Math.max(0, METHODS.indexOf(method))];
  return svg("path", { d: outline(shape, x, y, r), class: `sign ${method} ${more}` });
}

/** A logarithmic scale from values to px, with its ticks: at 1, 2, 5 if they have room, otherwise at powers of ten. */
function logScale(values, from, to) {
  const low = Math.log10(Math.min(...values)) - 0.12;
  const high = Math.log10(Math.max(...values)) + 0.12;
  const place = (value) => from + ((Math.log10(value) - low) / (high - low)) * (to - from);
  const room = Math.abs(to - from) / (high - low); // px a decade
  const steps = room > 110 ? [1, 2, 5] : [1];
  const skip = Math.max(1, Math.ceil(44 / room));
  const ticks = [];
  for (let power = Math.floor(low); power <= high; power += 1) {
    if (power % skip !== 0) continue;
    for (const step of steps) {
      const tick = step * 10 ** power;
      if (Math.log10(tick) >= low && Math.log10(tick) <= high) ticks.push(Number(tick.toPrecision(2)));
    }
  }
  return { place, ticks };
}

/**
 * Draw `points` ({method, x [ms], y [mm], best, converged, label}), the fastest first, into `box`; `words` describes a
 * point. A `label` stands beside its point.
 */
export function drawPlot(box, points, words) {
  const width = Math.max(280, box.clientWidth);
  const height = Math.round(Math.min(440, Math.max(280, 0.5 * width)));
  const x = logScale(points.map((point) => point.x), MARGIN.left, width - MARGIN.right);
  const y = logScale(points.map((point) => point.y), height - MARGIN.bottom, MARGIN.top);
  const bottom = height - MARGIN.bottom;
  const right = width - MARGIN.right;

  const grid = svg("g", { class: "grid" });
  for (const tick of x.ticks) {
    const at = x.place(tick);
    grid.append(svg("line", { x1: at, x2: at, y1: MARGIN.top, y2: bottom }));
    grid.append(svg("text", { x: at, y: bottom + 20, "text-anchor": "middle" }, String(tick)));
  }
  for (const tick of y.ticks) {
    const at = y.place(tick);
    grid.append(svg("line", { x1: MARGIN.left, x2: right, y1: at, y2: at }));
    grid.append(svg("text", { x: MARGIN.left - 9, y: at + 4, "text-anchor": "end" }, String(tick)));
  }
  const middle = 0.5 * (MARGIN.top + bottom);
  grid.append(svg("text", { x: 0.5 * (MARGIN.left + right), y: height - 6, "text-anchor": "middle", class: "axis" }, "time of a solve [ms]"));
  grid.append(svg("text", { x: 14, y: middle, "text-anchor": "middle", class: "axis", transform: `rotate(-90 14 ${middle})` }, "error [mm]"));

  const best = points.filter((point) => point.best).map((point) => `${x.place(point.x)},${y.place(point.y)}`);
  const front = svg("polyline", { points: best.join(" "), class: "front" });
  const signs = svg("g", {});
  for (const point of points) {
    const rank = point.best ? "best" : point.converged === false ? "failed" : "";
    const [left, top] = [x.place(point.x), y.place(point.y)];
    signs.append(sign(point.method, left, top, point.best || point.label ? 5.5 : 4.5, rank));
    if (!point.label) continue;
    const beyond = left > 0.6 * width;
    signs.append(svg("text", { x: left + (beyond ? -12 : 12), y: top - 8, "text-anchor": beyond ? "end" : "start", class: "label" }, point.label));
  }
  const ring = svg("circle", { r: 11, class: "ring", visibility: "hidden" });
  const drawing = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, "aria-hidden": "true" }, grid, front, signs, ring);
  const tip = make("div", { className: "tip", hidden: true });
  box.replaceChildren(drawing, tip);

  function point(index) {
    const { x: at, y: level } = points[index];
    const [left, top] = [x.place(at), y.place(level)];
    ring.setAttribute("cx", left);
    ring.setAttribute("cy", top);
    ring.setAttribute("visibility", "visible");
    tip.textContent = words(points[index]);
    tip.hidden = false;
    tip.style.left = `${Math.min(Math.max(0, left - 0.5 * tip.offsetWidth), width - tip.offsetWidth)}px`;
    tip.style.top = `${top > tip.offsetHeight + 20 ? top - tip.offsetHeight - 16 : top + 18}px`;
  }

  function leave() {
    ring.setAttribute("visibility", "hidden");
    tip.hidden = true;
  }

  /** The index of the point that a pointer event selects, or -1. */
  function meant(event) {
    const corner = drawing.getBoundingClientRect();
    const far = points.map((each) => Math.hypot(x.place(each.x) + corner.left - event.clientX, y.place(each.y) + corner.top - event.clientY));
    const nearest = far.indexOf(Math.min(...far));
    return far[nearest] < REACH ? nearest : -1;
  }

  return { point, leave, meant };
}

/** The finding in words: the fastest solves within 1 and 0.1 mm, or else the most accurate one. */
export function finding(points) {
  const solved = points.filter((point) => point.converged !== false && point.method !== "auto"); // without estimates
  const said = [1, 0.1].flatMap((error) => {
    const within = solved.filter((point) => point.y <= error).map((point) => point.x);
    return within.length === 0 ? [] : [`within ${error} mm in ${short(Math.min(...within))} ms`];
  });
  if (solved.length === 0) return "No solve converged";
  if (said.length === 0) {
    const [best] = [...solved].sort((one, other) => one.y - other.y);
    said.push(`within ${short(best.y)} mm in ${short(best.x)} ms`);
  }
  const sentence = said.join(", ");
  return sentence[0].toUpperCase() + sentence.slice(1);
}
