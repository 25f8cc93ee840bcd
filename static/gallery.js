// The gallery: one card for each ready scene, which opens it in the live scene.

import { make, read } from "./dom.js";
import { showScene } from "./stage.js";

const list = document.getElementById("gallery-list");
const note = document.getElementById("gallery-note");
const caption = document.getElementById("caption");
const curl = document.getElementById("example-curl");
const stage = document.getElementById("stage");
const FIRST = "paper-25"; // the scene to show if the address names none
let chosen = null;

function curlLine(example) {
  const origin = window.location.origin;
  return `curl -s ${origin}${example.links.self} |\n  curl -s ${origin}/v1/predictions -H 'Content-Type: application/json' -d @-`;
}

function choose(example) {
  chosen = example;
  for (const card of list.querySelectorAll("a[data-example]")) {
    if (card.dataset.example === example.name) card.setAttribute("aria-current", "true");
    else card.removeAttribute("aria-current");
  }
  caption.textContent = `${example.title}. ${example.description}`;
  curl.textContent = curlLine(example);
  showScene(example.name);
}

function card(example) {
  const open = make(
    "a",
    { href: `/?example=${example.name}`, className: "open", "data-example": example.name },
    make("img", { src: example.links.picture, alt: "", width: 320, height: 200 }),
    make("strong", {}, example.title),
    make("span", {}, example.description),
  );
  open.addEventListener("click", (event) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return; // the browser opens a new tab
    event.preventDefault();
    if (example !== chosen) window.history.pushState(null, "", open.getAttribute("href"));
    choose(example);
    stage.scrollIntoView({ block: "nearest" });
  });
  const json = make("a", { href: example.links.self, className: "json", "aria-label": `${example.title}, as JSON` }, "JSON");
  return make("li", { className: "card" }, open, json);
}

export async function showGallery() {
  try {
    const { examples } = await read("/v1/examples");
    list.replaceChildren(...examples.map(card));
    note.hidden = true;
    const named = (name) => examples.find((example) => example.name === name);
    const follow = () => {
      const asked = named(new URLSearchParams(window.location.search).get("example")) ?? named(FIRST);
      if (asked !== chosen) choose(asked); // the same scene: only a step on the page, edits in the scene stay
    };
    window.addEventListener("popstate", follow);
    follow();
  } catch {
    note.textContent = "The gallery can't be loaded right now.";
  }
}
