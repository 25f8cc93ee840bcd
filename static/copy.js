// Examples to copy, with the address of this service in them.

export function offerCopies() {
  for (const part of document.querySelectorAll(".origin")) part.textContent = window.location.origin;
  for (const button of document.querySelectorAll("button[data-copy]")) {
    const source = document.getElementById(button.dataset.copy);
    button.addEventListener("click", async () => {
      try {
        await navigator.clipboard.writeText(source.textContent);
        button.textContent = "Copied";
      } catch {
        window.getSelection().selectAllChildren(source); // there is no clipboard without https: select the text instead
        button.textContent = "Selected";
      }
      window.setTimeout(() => { button.textContent = "Copy"; }, 1600);
    });
  }
}
