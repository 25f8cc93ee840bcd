"use strict";

// Runs before the page is drawn, so that the page does not flash in the wrong theme.
try {
  const chosen = window.localStorage.getItem("theme");
  if (chosen === "light" || chosen === "dark") document.documentElement.dataset.theme = chosen;
} catch {
  // storage may be forbidden: then the system's theme applies
}
