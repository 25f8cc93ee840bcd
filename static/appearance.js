// Light or dark: the theme of the system, unless the user chose another with the button.

const system = window.matchMedia("(prefers-color-scheme: dark)");
const root = document.documentElement;

export function isDark() {
  return (root.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";
}

/** Wire the button, and call `changed` whenever the page turns light or dark. */
export function offerThemes(button, changed) {
  const label = () => { button.setAttribute("aria-pressed", String(isDark())); };
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    try {
      window.localStorage.setItem("theme", root.dataset.theme);
    } catch {
      // storage may be forbidden: the choice then lasts as long as the page
    }
    label();
    changed();
  });
  system.addEventListener("change", () => {
    label();
    if (root.dataset.theme === undefined) changed();
  });
  label();
}
