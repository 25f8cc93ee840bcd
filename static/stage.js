// The live scene with the chosen example, shown as soon as the service can solve.

import { isDark } from "./appearance.js";

const RETRY = 2000; // ms
const COMPILING = "urn:dlo:problem:not-ready";
const SAID = {
  compiling: "The solver is being compiled or loaded. The first time this takes a few minutes, later a few seconds. The scene then opens by itself.",
  silent: "The service does not respond. This page keeps trying.",
};
const scene = document.getElementById("scene");
const waiting = document.getElementById("waiting");
const full = document.getElementById("full");
const note = document.getElementById("stage-note");
let example = null;
let awake = false; // whether the scene to show at first is known
let waits = false; // for the service
let dark = false; // the theme that the scene is shown in
let touched = false; // whether the user has worked in the scene: loading it again would undo that

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
  if (awake) load();
}

/** Show the scene in the theme of the page, unless the user has worked in it. */
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

/** Load the scene as soon as the service can solve, with a message meanwhile. */
async function load() {
  if (waits) return; // it will load the scene that is chosen by then
  waits = true;
  for (let now = await state(); now !== "ready"; now = await state()) {
    waiting.hidden = false;
    waiting.textContent = SAID[now];
    await new Promise((resolve) => { window.setTimeout(resolve, RETRY); });
  }
  waits = false;
  waiting.hidden = true;
  scene.contentWindow.location.replace(full.href); // a new src would add a step to the history of Back
}

/** Show the scene from now on. */
export function awaken() {
  awake = true;
  load();
}
