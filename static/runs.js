// The table of recent runs, kept up to date.

import { make, read, withUnit } from "./dom.js";

const PERIOD = 5000; // ms
const PAGE = 8; // runs that are shown at first, and added at a time
const STATUS = {
  converged: "converged", max_iterations: "not converged", stalled: "stalled", time_limit: "out of time",
};
const MOST = 1000; // that the service lists at once
const note = document.getElementById("runs-note");
const box = document.getElementById("runs-table");
const older = document.getElementById("runs-older");
let most = PAGE;
let shown = null;

function when(created) {
  const text = new Date(created).toLocaleString([], { dateStyle: "medium", timeStyle: "medium" });
  return make("time", { dateTime: created }, text);
}

function row(run) {
  const cell = (content, className = "") => make("td", { className }, ...[content].flat());
  const named = run.name === "" ? make("span", { className: "muted" }, "no name") : run.name;
  const error = run.error_estimate === null ? null : run.error_estimate * 1e3;
  const status = make("span", { className: `status ${run.status}` }, STATUS[run.status] ?? run.status);
  const time = when(run.created);
  const link = (href, text) => make("a", { href, "aria-label": `${text} of ${run.name || time.textContent}` }, text);
  const links = [
    link(`/scene/?run=${run.id}`, "open in the scene"), link(run.links.viewer, "recording"), link(run.links.scene, "scene"),
    link(run.links.self, "JSON"),
  ];
  return make("tr", {}, cell(time), cell(named, "name"), cell(status), cell(run.method),
    cell(withUnit(run.wall_time * 1e3, "ms"), "number"), cell(withUnit(error, "mm"), "number"), cell(links, "links"));
}

async function refresh() {
  if (document.hidden) return;
  try {
    const { predictions: runs, total } = await read(`/v1/predictions?limit=${most}`);
    older.hidden = runs.length >= total || most >= MOST;
    note.hidden = runs.length > 0;
    note.textContent = "No runs yet. Keep one in the scene, or post a scene to the API.";
    const ids = runs.map((run) => run.id).join();
    if (ids === shown) return;
    shown = ids;
    box.hidden = runs.length === 0;
    box.querySelector("tbody").replaceChildren(...runs.map(row));
  } catch {
    note.hidden = false;
    note.textContent = shown ? "The service does not respond. These were the last runs." : "The list of runs can't be loaded right now.";
  }
}

export function followRuns() {
  refresh();
  older.addEventListener("click", () => {
    most = Math.min(most + PAGE, MOST);
    refresh();
  });
  window.setInterval(refresh, PERIOD);
  document.addEventListener("visibilitychange", refresh);
}
