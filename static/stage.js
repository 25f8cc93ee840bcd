// The live scene: shown once the service can solve, with the chosen example.

import { isDark } from "./appearance.js";

const RETRY = 2000; // ms
const COMPILING = "urn:dlo:problem:not-ready";
const SAID = {
  compiling: "The solver is being compiled or loaded. The first time that takes some minutes, later seconds; this page then comes alive by itself.",
  silent: "The service does not answer. This page tries again by itself.",
};
const scene = document.getElementById("scene");
const waiting = document.getElementById("waiting");
const full = document.getElementById("full");
const note = document.getElementById("stage-note");
let example = null;
let awake = false;
let dark = false; // the theme that the scene is shown in
let touched = false; // whether someone was at work in the scene: to load it anew would undo that

scene.addEventListener("load", () => {
  touched = false;
  note.hidden = true;
  for (const kind of ["pointerdown", "keydown"])
    scene.contentWindow.addEventListener(kind, () => { touched = true; }, { capture: true, once: true });
});

function address() {
  const query = [example === null ? "" : `example=${encodeURIComponent(example)}`, isDark() ? "darkMode" : ""];
  const asked = query.filter((part) => part !== "").join("&");
  return asked === "" ? "/scene/" : `/scene/?${asked}`;
}

export function showScene(name = example) {
  example = name;
  dark = isDark();
  full.href = address();
  if (awake) scene.contentWindow.location.replace(full.href); // another src would be a step of its own for Back
}

/** Show the scene in the theme of the page, if nobody was at work in it. */
export function showTheme() {
  if (!touched) return showScene();
  full.href = address();
  note.hidden = isDark() === dark;
}

async function state() {
  try {
    const answer = await fetch("/ready");
    if (answer.ok) return "ready";
    return (await answer.json()).type === COMPILING ? "compiling" : "silent";
  } catch {
    return "silent";
  }
}

/** Wait until the service can solve, saying so meanwhile; then show the scene. */
export async function whenReady() {
  for (let now = await state(); now !== "ready"; now = await state()) {
    waiting.hidden = false;
    waiting.textContent = SAID[now];
    await new Promise((resolve) => { window.setTimeout(resolve, RETRY); });
  }
  waiting.hidden = true;
  awake = true;
  showScene();
}
