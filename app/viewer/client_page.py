"""viser's page, with what it lacks for a scene: a title, words where the service is gone, room beside the scrollbar."""

from pathlib import Path

import viser

_PAGE = Path(viser.__file__).parent / "client" / "build" / "index.html"
TITLE = "dlo scene"
FOLD = "told"  # class of what is folded to three lines until it is clicked
GONE = "The service does not answer. This page connects again as soon as it does."
# The client ignores what Number.isFinite calls no number, as "-", but takes "-0" for one and draws the field again, as
# 0, before the rest of -0.2 is typed. Here that is no number while it is typed; who leaves the field at it means 0.
_NEGATIVE_NUMBERS = r"""<script>
{
  const begun = (field) => field.inputMode === "decimal" && /^-\.?0[.0]*$/.test(field.value);
  const isFinite = Number.isFinite;
  let typing = false;
  Number.isFinite = (number) => isFinite(number) && !(typing && number === 0);
  addEventListener("input", ({ target }) => { typing = begun(target); }, true);
  addEventListener("input", () => { typing = false; });
  addEventListener("focusout", ({ target }) => {
    if (!begun(target)) return;
    target.setRangeText("0", 0, target.value.length);
    target.dispatchEvent(new InputEvent("input", { bubbles: true }));
  }, true);
}
</script>
"""
# The client freezes the panel while there is no connection: each part of it, also one inside another, and pales it.
# It does so while the page begins, too, of which nothing is told for a second.
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
@keyframes told {{ from {{ opacity: 0; }} }}
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
    """Return the page of the scene, as HTML."""
    page = _PAGE.read_text(encoding="utf-8").replace("<title>Viser</title>", f"<title>{TITLE}</title>")
    return page.replace("</head>", f"{_NEGATIVE_NUMBERS}{_STYLE}</head>").encode()
