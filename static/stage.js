// The live scene: shown once the service can solve, with the chosen example.

import { isDark } from "./appearance.js";

const RETRY = 2000; // ms
const COMPILING = "urn:dlo:problem:not-ready";
const SAID = {
  compiling: "The solver is being compiled for this machine. That takes a minute or two, once; this page then comes alive by itself.",
  silent: "The service does not answer. This page tries again by itself.",
};
const scene = document.getElementById("scene");
const waiting = document.getElementById("waiting");
const full = document.getElementById("full");
let example = null;
let awake = false;

function address(dark) {
  const query = [example === null ? "" : `example=${encodeURIComponent(example)}`, dark ? "darkMode" : ""];
  const asked = query.filter((part) => part !== "").join("&");
  return asked === "" ? "/scene/" : `/scene/?${asked}`;
}

export function showScene(name = example) {
  example = name;
  full.href = address(isDark());
  if (awake) scene.contentWindow.location.replace(full.href); // another src would be a step of its own for Back
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
