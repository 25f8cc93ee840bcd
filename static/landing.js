"use strict";

// The scene follows the page's colours; it takes them from its address.
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const scene = document.getElementById("scene");

function sceneAddress() {
  return dark.matches ? "/scene/?darkMode" : "/scene/";
}

function showScene() {
  scene.src = sceneAddress();
  document.getElementById("full").href = sceneAddress();
}

dark.addEventListener("change", showScene);
showScene();

// Examples: the address of this very service, and a button that copies.
for (const part of document.querySelectorAll(".origin")) part.textContent = window.location.origin;

for (const button of document.querySelectorAll("button[data-copy]")) {
  button.addEventListener("click", async () => {
    const source = document.getElementById(button.dataset.copy);
    try {
      await navigator.clipboard.writeText(source.textContent);
      button.textContent = "Copied";
    } catch {
      window.getSelection().selectAllChildren(source); // no clipboard without https: select it instead
      button.textContent = "Selected";
    }
    window.setTimeout(() => { button.textContent = "Copy"; }, 1600);
  });
}

// Recent runs.
const note = document.getElementById("runs-note");
const tableBox = document.getElementById("runs-table");
const STATUS = {
  converged: "converged", max_iterations: "not converged", stalled: "stalled", time_limit: "out of time",
};

function withUnit(value, unit) {
  if (value === null || value === undefined) return "–";
  return `${value < 10 ? value.toPrecision(2) : Math.round(value)} ${unit}`;
}

function cell(row, content, className = "") {
  const td = row.insertCell();
  td.className = className;
  td.append(...[content].flat());
}

function link(href, text) {
  const anchor = document.createElement("a");
  anchor.href = href;
  anchor.textContent = text;
  return anchor;
}

function when(created) {
  const time = document.createElement("time");
  time.dateTime = created;
  time.textContent = new Date(created).toLocaleString([], { dateStyle: "medium", timeStyle: "medium" });
  return time;
}

function showRuns(runs) {
  tableBox.hidden = runs.length === 0;
  note.hidden = runs.length > 0;
  note.textContent = "No runs yet. Press “Keep this run” under Share in the scene, or post a scene to the API.";
  const rows = document.createElement("tbody");
  for (const run of runs) {
    const row = rows.insertRow();
    cell(row, when(run.created));
    cell(row, STATUS[run.status] ?? run.status);
    cell(row, run.method);
    cell(row, withUnit(run.wall_time * 1e3, "ms"), "number");
    cell(row, withUnit(run.error_estimate === null ? null : run.error_estimate * 1e3, "mm"), "number");
    cell(row, [link(run.links.viewer, "recording"), link(run.links.self, "JSON")]);
  }
  tableBox.querySelector("tbody").replaceWith(rows);
}

let shown = "";

async function loadRuns() {
  if (document.hidden) return;
  try {
    const answer = await fetch("/v1/predictions?limit=8", { headers: { Accept: "application/json" } });
    if (!answer.ok) throw new Error(answer.statusText);
    const runs = (await answer.json()).predictions;
    const ids = runs.map((run) => run.id).join();
    if (ids === shown && ids !== "") return;
    shown = ids;
    showRuns(runs);
  } catch {
    if (shown === "") note.textContent = "The list of runs can't be read just now.";
  }
}

loadRuns();
window.setInterval(loadRuns, 5000);
document.addEventListener("visibilitychange", loadRuns);
