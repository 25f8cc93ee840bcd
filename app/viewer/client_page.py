"""viser's page with additions for the scene: a title, a message while the service is gone, room at the scrollbar."""

from pathlib import Path

import viser

_PAGE = Path(viser.__file__).parent / "client" / "build" / "index.html"
TITLE = "dlo scene"
FOLD = "told"  # CSS class of texts that are folded to three lines until they are clicked
GONE = "The service does not respond. This page reconnects as soon as it does."
# The client ignores texts that Number.isFinite rejects, such as "-". But it accepts "-0", "0." and "1.0", and redraws
# them as 0, 0 and 1 before the rest of -0.2, 0.5 or 1.07 is typed, which then makes another number. So this script
# rejects them while single keys are pressed, and puts the number when the user leaves the field.
_BEGUN_NUMBERS = r"""<script>
{
  const begun = (field) => field.inputMode === "decimal" && /^-\.?0+$|[0-9]\.$|\.[0-9]*0$/.test(field.value);
  const isFinite = Number.isFinite;
  let typed = NaN;
  Number.isFinite = (number) => isFinite(number) && number !== typed;
  addEventListener("input", ({ target, data, inputType }) => {
    const key = data?.length === 1 || inputType?.startsWith("delete");
    typed = key && begun(target) ? Number(target.value) : NaN;
  }, true);
  addEventListener("input", () => { typed = NaN; });
  addEventListener("focusout", ({ target }) => {
    if (!begun(target)) return;
    const number = target.value.replace(/\.0*$|(\.[0-9]*[1-9])0+$/, "$1").replace(/^-?0*$/, "0");
    target.setRangeText(number, 0, target.value.length);
    target.dispatchEvent(new InputEvent("input", { bubbles: true }));
  }, true);
}
</script>
"""
# In vector fields and beside sliders, the client drops the "e" of 1e-1 and moves the "-" to the front: it reads -11. So
# this script rejects the "e" and all that follows, until the user deletes something, replaces all or leaves the field.
PLAIN_NUMBERS = "Write 0.1, not 1e-1, in this field. What you typed from the e on is left out."
_POWERS_OF_TEN = f"""<script>
{{
  let refused = false;
  const refuse = (field, words) => {{ refused = words !== ""; field.setCustomValidity(words); }};
  addEventListener("beforeinput", (event) => {{
    const {{ target, data }} = event;
    if (target.inputMode !== "decimal") return;
    const whole = target.selectionStart === 0 && target.selectionEnd === target.value.length;
    if (data === null || whole) refuse(target, "");
    if (/e/i.test(data ?? "")) refuse(target, {PLAIN_NUMBERS!r});
    if (!refused) return;
    event.preventDefault();
    target.reportValidity();
  }}, true);
  addEventListener("focusout", ({{ target }}) => {{ if (refused) refuse(target, ""); }}, true);
}}
</script>
"""
# When the user leaves the field beside a slider, the client silently changes a number beyond an end to that end. This
# script keeps the number, so that the panel can say what is allowed.
_BEYOND_SLIDERS = """<script>
addEventListener("focusout", (event) => {
  const { target } = event;
  if (target.inputMode !== "decimal") return;
  const slider = target.closest(".mantine-NumberInput-root")?.parentElement.querySelector(":scope > * [role=slider]");
  const beyond = slider && (Number(target.value) < slider.ariaValueMin || Number(target.value) > slider.ariaValueMax);
  if (beyond) event.stopPropagation();
}, true);
</script>
"""
# A failure stays in view while the panel is scrolled. A part of the panel that hides what overflows it would hold it
# back; it need only clip that.
_HIDES = 'div:has(> div[style*="transition: opacity 150ms"])'
_FAILURES = ", ".join(
    f'[data-status="{status}"]' for status in ("impossible", "max_iterations", "stalled", "time_limit")
)
# Without a connection, the client freezes and dims the panel: each part of it, nested parts too. It does the same while
# the page loads, so the message appears only after a second.
_FROZEN = 'div[style*="opacity: 0.5"][style*="pointer-events: none"]'
_STYLE = f"""<style>
{_FROZEN}:not({_FROZEN} *)::before {{
  content: "{GONE}";
  display: block;
  position: sticky;
  top: 0.4rem;
  z-index: 9;
  margin: 0 0.75rem 0.6rem;
  padding: 0.55rem 0.7rem;
  border-radius: 0.5rem;
  background: rgb(240, 178, 166);
  color: rgb(64, 16, 10);
  font-size: 0.8rem;
  font-weight: 700;
  animation: told 0.2s 1s both;
}}
{_HIDES} {{ overflow: clip !important; }}
div:has(> :is({_FAILURES})) {{
  position: sticky;
  top: 0;
  z-index: 8;
  max-height: 40vh;
  overflow-y: auto;
  background: var(--mantine-color-body);
}}
@keyframes told {{ from {{ opacity: 0; }} }}
.mantine-NumberInput-input[style*="padding-right: 1.75em"] {{
  padding-inline: 0.25em 1.4em !important;
  letter-spacing: -0.5px;
}}
.{FOLD} > summary {{ list-style: none; cursor: pointer; }}
.{FOLD} > summary::after {{ content: "more"; text-decoration: underline; }}
.{FOLD}[open] > summary::after {{ content: "less"; }}
.{FOLD}:not([open]) > summary > div {{
  display: -webkit-box;
  -webkit-box-orient: vertical;
  -webkit-line-clamp: 3;
  overflow: hidden;
}}
.mantine-ScrollArea-viewport:not(.mantine-ScrollArea-viewport *) > div {{ padding-right: 0.4em; }}
</style>
"""


def client_page() -> bytes:
    """Return the page of the scene as HTML."""
    page = _PAGE.read_text(encoding="utf-8").replace("<title>Viser</title>", f"<title>{TITLE}</title>")
    return page.replace("</head>", f"{_BEGUN_NUMBERS}{_POWERS_OF_TEN}{_BEYOND_SLIDERS}{_STYLE}</head>").encode()
