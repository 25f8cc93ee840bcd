import json
import re
import subprocess
import sys
from urllib.parse import urlsplit

import httpx
import pytest
from playwright.sync_api import Page, Route, expect

from app.pages.gallery import examples
from dlocore.study.style import COLOURS

pytestmark = pytest.mark.browser
DESKTOP, PHONE, NARROW = (1400, 900), (390, 844), (320, 640)
SCENE_IS_SHOWN = '[data-status="converged"]'
# as GET /v1/calibration answers: march from 1 to 100 ms, an order of magnitude each, and two that are worse
CALIBRATION = {
    "machine": {"processor": "Test processor", "cores": "2"},
    "measured_at": "2026-01-31T12:00:00Z",
    "points": [
        {"method": "march", "n_u": 33, "n_t": 65, "wall_time": 0.1, "error": 3e-5},
        {"method": "march", "n_u": 9, "n_t": 13, "wall_time": 0.001, "error": 3e-3},
        {"method": "march", "n_u": 17, "n_t": 25, "wall_time": 0.01, "error": 3e-4},
        {"method": "spacetime", "n_u": 9, "n_t": 13, "wall_time": 0.01, "error": 3e-3},
        {"method": "spacetime", "n_u": 17, "n_t": 25, "wall_time": 0.1, "error": 3e-3},
    ],
    "front": [1, 2, 0],
}
DEFAULT = {"method": "auto", "n_u": 19, "n_t": 28, "wall_time": 0.02, "error": 2e-4}
CALIBRATED = re.compile(r"/v1/calibration\?")


def open_page(
    witness, service, path: str = "/", size: tuple[int, int] = DESKTOP, scheme: str = "light", with_scene: bool = False
) -> Page:
    """Open the landing page; without the scene, which is slow to draw without a GPU, if the test does not need it."""
    page = witness.page
    if not with_scene:
        page.route("**/scene/*", lambda route: route.fulfill(body="", content_type="text/html"))
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.emulate_media(color_scheme=scheme)
    page.goto(f"{service.address}{path}")
    expect(page.locator("#gallery-list > li")).to_have_count(len(examples()))
    return page


def wait_for_scene(page: Page, address: str) -> None:
    """Wait until the page shows the scene at an address; a running scene redirects from there to a tab's address."""
    frame = page.locator("#scene").element_handle().content_frame()
    assert frame is not None
    name = re.search(r"example=([\w-]+)", address)
    dark = r"\?darkMode" if "darkMode" in address else r"(\?(?!darkMode)|$)"
    running = rf"/scene/{'new' if name is None else name[1]}/[\w-]+/{dark}"
    frame.wait_for_url(re.compile(rf"({re.escape(address)}$|{running})"))


def asks_for_calibration(page: Page) -> None:
    """Let the page request a calibration, whether or not the service has one."""
    page.route("**/health", lambda route: route.fulfill(json={"status": "ok", "calibrated": True}))


def with_calibration(page: Page) -> None:
    """Let the page read `CALIBRATION`, because measuring a calibration takes minutes."""
    asks_for_calibration(page)
    page.route(CALIBRATED, lambda route: route.fulfill(json=CALIBRATION))


def is_measured(service) -> bool:
    return httpx.get(f"{service.address}/v1/calibration").status_code == 200


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_shows_the_scene_without_an_error_and_asks_no_other_host(service, witness, scheme):
    page = open_page(witness, service, scheme=scheme, with_scene=True)
    expect(page.get_by_role("heading", level=1)).to_be_visible()
    scene = page.frame_locator("#scene")
    expect(scene.locator(SCENE_IS_SHOWN)).to_be_visible()
    expect(page.locator("#runs-note, #runs-table table").locator("visible=true")).not_to_have_text("Loading …")
    assert scene.locator("html[data-mantine-color-scheme='dark']").count() == (scheme == "dark")
    assert witness.errors == []
    assert witness.hosts == {urlsplit(service.address).netloc}


def test_a_click_in_the_gallery_opens_the_scene_and_a_command_for_it(service, witness):
    page = open_page(witness, service, with_scene=True)
    example = examples()["keeps-its-bend"]
    page.get_by_role("link", name=example.title).first.click()
    wait_for_scene(page, "/scene/?example=keeps-its-bend")
    expect(page.locator("#full")).to_have_attribute("href", re.compile(r"/scene/\?example=keeps-its-bend$"))
    expect(page.locator("#caption")).to_contain_text(example.description)
    expect(page.locator("a[aria-current]")).to_have_count(1)
    expect(page.locator("a[aria-current]")).to_contain_text(example.title)
    expect(page.frame_locator("#scene").locator(SCENE_IS_SHOWN)).to_be_visible()
    assert urlsplit(page.url).query == "example=keeps-its-bend"
    command = page.locator("#example-curl").inner_text()
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=True, timeout=60)
    assert json.loads(done.stdout)["status"] == "converged"


def test_back_and_forward_lead_from_scene_to_scene(service, witness):
    page = open_page(witness, service)
    example_of = {name: examples()[name] for name in ("paper-25", "two-grippers", "twist-buckles")}

    def is_chosen(name: str, query: str) -> None:
        wait_for_scene(page, f"/scene/?example={name}")
        assert urlsplit(page.url).query == query
        expect(page.locator("a[aria-current]")).to_have_count(1)
        expect(page.locator("a[aria-current]")).to_contain_text(example_of[name].title)
        expect(page.locator("#caption")).to_contain_text(example_of[name].description)
        expect(page.locator("#example-curl")).to_contain_text(f"/v1/examples/{name} ")

    for name in ("two-grippers", "twist-buckles"):
        page.get_by_role("link", name=example_of[name].title).first.click()
        is_chosen(name, f"example={name}")
    page.get_by_role("button", name="Dark theme").click()  # loads the scene again, which adds no step to the history
    page.get_by_role("button", name="Dark theme").click()
    page.go_back()
    is_chosen("two-grippers", "example=two-grippers")
    page.go_back()
    is_chosen("paper-25", "")
    page.go_forward()
    is_chosen("two-grippers", "example=two-grippers")


def test_a_step_on_the_page_leaves_the_scene_as_it_is(service, witness):
    page = open_page(witness, service)
    wait_for_scene(page, "/scene/?example=paper-25")
    page.evaluate("document.getElementById('scene').contentWindow.changed = true")
    page.get_by_role("link", name="Speed").click()
    page.go_back()
    page.wait_for_timeout(200)
    assert page.evaluate("document.getElementById('scene').contentWindow.changed") is True


def test_an_address_with_an_example_opens_it(service, witness):
    page = open_page(witness, service, "/?example=two-grippers")
    wait_for_scene(page, "/scene/?example=two-grippers")
    expect(page.locator("a[aria-current]")).to_contain_text(examples()["two-grippers"].title)


@pytest.mark.parametrize("path", ["/", "/?example=no-such"], ids=["none", "unknown"])
def test_the_scene_that_is_shown_at_first_is_the_chosen_one(service, witness, path):
    page = open_page(witness, service, path)
    example = examples()["paper-25"]
    wait_for_scene(page, "/scene/?example=paper-25")
    expect(page.locator("a[aria-current]")).to_contain_text(example.title)
    expect(page.locator("#caption")).to_contain_text(example.description)
    expect(page.locator("#example-curl")).to_contain_text("/v1/examples/paper-25 ")


def test_every_card_has_its_picture_and_its_json(service, witness):
    page = open_page(witness, service)
    for card in page.locator("#gallery-list > li").all():
        expect(card.locator("img")).to_have_js_property("naturalWidth", 320)
        assert httpx.get(service.address + (card.locator("a.json").get_attribute("href") or "")).status_code == 200


def test_the_page_says_that_the_solver_is_compiled_and_comes_alive_by_itself(service, witness):
    page = witness.page
    asked = []

    def at_first_not_ready(route: Route) -> None:
        asked.append(route)
        if len(asked) < 3:
            route.fulfill(status=503, json={"type": "urn:dlo:problem:not-ready"})
        else:
            route.continue_()

    page.route("**/ready", at_first_not_ready)
    page.goto(service.address)
    expect(page.locator("#waiting")).to_contain_text("being compiled")
    assert page.evaluate("document.getElementById('scene').contentWindow.location.href") == "about:blank"
    expect(page.frame_locator("#scene").locator(SCENE_IS_SHOWN)).to_be_visible()
    expect(page.locator("#waiting")).to_be_hidden()


def test_a_scene_chosen_while_the_service_is_gone_is_shown_as_soon_as_it_is_back(service, witness):
    page = open_page(witness, service)
    wait_for_scene(page, "/scene/?example=paper-25")
    page.route("**/ready", lambda route: route.abort())
    page.get_by_role("link", name=examples()["two-grippers"].title).first.click()
    expect(page.locator("#waiting")).to_contain_text("does not respond")
    wait_for_scene(page, "/scene/?example=paper-25")
    page.unroute("**/ready")
    wait_for_scene(page, "/scene/?example=two-grippers")
    expect(page.locator("#waiting")).to_be_hidden()


# --- what accuracy costs ---


def test_a_machine_that_is_not_measured_is_told_how_to(service, witness):
    asks_for_calibration(witness.page)
    witness.page.route(CALIBRATED, lambda route: route.fulfill(status=404, json={"type": "urn:dlo:problem:not-found"}))
    page = open_page(witness, service)
    expect(page.locator("#plot-note")).to_contain_text("dlo calibrate")
    expect(page.locator("#plot-figure")).to_be_hidden()
    expect(page.locator("#measure")).to_be_hidden()  # there is nothing that could measure


def test_the_button_measures_and_shows_what_comes_of_it(service, witness):
    page = witness.page
    measured = []
    event = 'id: {0}\nevent: progress\ndata: {{"number": {0}, "done": {0}, "total": 2, "what": "part {0}"}}\n\n'
    course = event.format(0) + event.format(1) + "id: 2\nevent: done\ndata: {}\n\n"

    def answer(route: Route) -> None:
        if measured:
            route.fulfill(json=CALIBRATION)
        else:
            route.fulfill(status=404, json={"type": "urn:dlo:problem:not-calibrated"})

    def take_up(route: Route) -> None:
        measured.append(route.request.method)
        route.fulfill(status=202, json={})

    asks_for_calibration(page)
    page.route(CALIBRATED, answer)
    page.route("**/v1/calibration", take_up)
    page.route("**/v1/calibration/events", lambda route: route.fulfill(body=course, content_type="text/event-stream"))
    open_page(witness, service)
    page.get_by_role("button", name="Measure this machine").click()
    expect(page.locator("#plot .sign")).to_have_count(len(CALIBRATION["points"]))
    expect(page.locator("#measure button")).to_be_enabled()
    expect(page.locator("#measure progress")).to_be_hidden()
    assert measured == ["POST"]


def test_the_plot_tells_motions_in_the_plane_from_those_in_space(service, witness):
    page = witness.page
    in_space = {**CALIBRATION, "points": CALIBRATION["points"][:3], "front": [1, 2, 0]}

    def answer(route: Route) -> None:
        route.fulfill(json=in_space if "dimensions=3" in route.request.url else CALIBRATION)

    asks_for_calibration(page)
    page.route(CALIBRATED, answer)
    open_page(witness, service)
    expect(page.locator("#plot .sign")).to_have_count(5)
    page.get_by_label("in space").check()
    expect(page.locator("#plot .sign")).to_have_count(3)


def test_measurements_that_cannot_be_loaded_leave_the_choice_at_those_that_are_shown(service, witness):
    page = witness.page
    with_calibration(page)
    page.route("**/v1/calibration?dimensions=3", lambda route: route.abort())
    open_page(witness, service)
    expect(page.locator("#plot .sign")).to_have_count(5)
    page.get_by_label("in space").click()
    expect(page.locator("#plot-note")).to_have_text("The measurements can't be loaded right now.")
    expect(page.locator("#plot-note")).to_be_visible()
    expect(page.get_by_label("in the plane")).to_be_checked()
    page.unroute("**/v1/calibration?dimensions=3")
    page.get_by_label("in space").check()
    expect(page.locator("#plot-note")).to_be_hidden()


def test_the_plot_shows_the_measurements_of_the_service_where_there_are_any(service, witness):
    page = open_page(witness, service)
    expect(page.locator("#plot" if is_measured(service) else "#plot-note code")).to_be_visible()


def test_the_plot_is_logarithmic_in_both_directions_and_has_every_point(service, witness):
    with_calibration(witness.page)
    page = open_page(witness, service)
    expect(page.locator("#plot .sign")).to_have_count(len(CALIBRATION["points"]))
    corners = page.locator("#plot .front").get_attribute("points") or ""
    front = [tuple(float(value) for value in corner.split(",")) for corner in corners.split()]
    assert len(front) == 3
    (x0, y0), (x1, y1), (x2, y2) = front
    assert x0 < x1 < x2
    assert y0 < y1 < y2  # down the picture: the slower, the better
    assert abs((x1 - x0) - (x2 - x1)) < 1e-6  # a factor of ten each, so the same way [px]; rounding alone
    assert abs((y1 - y0) - (y2 - y1)) < 1e-6
    for method in ("march", "spacetime"):
        colour = ", ".join(str(int(COLOURS[method][k : k + 2], 16)) for k in (1, 3, 5))
        expect(page.locator(f"#plot .sign.{method}").first).to_have_css("fill", f"rgb({colour})")
    expect(page.locator("#plot-finding")).to_have_text("Within 1 mm in 10 ms, within 0.1 mm in 100 ms")
    expect(page.locator("#plot-machine")).to_contain_text("Test processor")


def test_the_table_tells_the_same_as_the_plot(service, witness):
    with_calibration(witness.page)
    page = open_page(witness, service)
    page.get_by_text("Show as a table").click()
    rows = [row.split("\t") for row in page.locator("#plot-table tbody tr").all_inner_texts()]
    assert rows == [
        ["march", "9", "13", "1", "3", "yes"],
        ["march", "17", "25", "10", "0.3", "yes"],
        ["spacetime", "9", "13", "10", "3", ""],
        ["march", "33", "65", "100", "0.03", "yes"],
        ["spacetime", "17", "25", "100", "3", ""],
    ]


def test_pointing_at_a_point_and_walking_by_arrow_keys_tell_its_values(service, witness):
    with_calibration(witness.page)
    page = open_page(witness, service)
    page.locator("#plot .sign.spacetime").last.hover()
    expect(page.locator("#plot .tip")).to_have_text("spacetime, 17 × 25: 100 ms, 3 mm")
    page.mouse.move(0, 0)
    expect(page.locator("#plot .tip")).to_be_hidden()
    plot = page.get_by_role("slider", name="Measured solves")
    plot.focus()
    expect(plot).to_have_attribute("aria-valuetext", "march, 9 × 13: 1 ms, 3 mm, the best for its time")
    page.keyboard.press("End")
    expect(plot).to_have_attribute("aria-valuetext", "spacetime, 17 × 25: 100 ms, 3 mm")
    expect(page.locator("#plot .tip")).to_have_text("spacetime, 17 × 25: 100 ms, 3 mm")
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    expect(page.locator("#plot .tip")).to_have_text("march, 17 × 25: 10 ms, 0.3 mm")


def test_the_default_quality_is_a_dot_with_a_label(service, witness):
    page = witness.page
    asks_for_calibration(page)
    page.route(CALIBRATED, lambda route: route.fulfill(json={**CALIBRATION, "default": DEFAULT}))
    open_page(witness, service)
    expect(page.locator("#plot .sign")).to_have_count(len(CALIBRATION["points"]) + 1)
    expect(page.locator("#plot .label")).to_have_text("default quality")
    page.locator("#plot .sign.auto").hover()
    expect(page.locator("#plot .tip")).to_have_text("default quality, with error estimate: 20 ms, 0.2 mm")
    expect(page.locator("#plot-legend li")).to_contain_text(
        ["march", "spacetime", "default quality, with error estimate", "the best for its time"]
    )
    expect(page.locator("#plot-finding")).to_have_text("Within 1 mm in 10 ms, within 0.1 mm in 100 ms")
    page.get_by_text("Show as a table").click()
    rows = [row.split("\t") for row in page.locator("#plot-table tbody tr").all_inner_texts()]
    assert ["auto", "19", "28", "20", "0.2", ""] in rows


# --- recent runs ---


def test_a_new_run_appears_with_its_status_time_error_and_recording(service, witness):
    page = open_page(witness, service)
    scene = {**json.loads(examples()["paper-25"].document), "name": "Seen on the page"}
    run = httpx.post(f"{service.address}/v1/predictions", json=scene, timeout=60).json()
    row = page.locator("#runs-table tbody tr").filter(has=page.locator(f'a[href="{run["links"]["self"]}"]'))
    expect(row).to_contain_text("Seen on the page")
    expect(row).to_contain_text(run["status"])
    expect(row).to_contain_text(run["accuracy"]["method"])
    assert re.search(r"\d ms", row.inner_text())
    assert re.search(r"\d mm", row.inner_text())
    assert row.get_by_role("link", name="recording of Seen on the page").get_attribute("href") == run["links"]["viewer"]
    scene_file = row.get_by_role("link", name="scene of Seen on the page", exact=True)
    assert scene_file.get_attribute("href") == run["links"]["scene"]
    opens = row.get_by_role("link", name="open in the scene of Seen on the page")
    assert opens.get_attribute("href") == f"/scene/?run={run['id']}"


def test_the_list_of_runs_says_when_the_service_is_gone(service, witness):
    page = open_page(witness, service)
    note = page.locator("#runs-note")
    httpx.post(f"{service.address}/v1/predictions", content=examples()["paper-25"].document, timeout=60)
    expect(page.locator("#runs-table")).to_be_visible()
    expect(note).to_be_hidden()
    page.route("**/v1/predictions?*", lambda route: route.abort())
    expect(note).to_have_text("The service does not respond. These were the last runs.")
    page.unroute("**/v1/predictions?*")
    expect(note).to_be_hidden()


def test_older_runs_are_shown_on_demand(service, witness):
    page = witness.page
    run = {"name": "", "created": "2026-01-31T12:00:00Z", "status": "converged", "method": "march", "wall_time": 0.01}
    run |= {"error_estimate": None, "links": dict.fromkeys(("self", "viewer", "scene"), "/")}

    def answer(route: Route) -> None:
        limit = int(route.request.url.rpartition("=")[2])
        route.fulfill(json={"predictions": [{**run, "id": str(k)} for k in range(11)][:limit], "total": 11})

    page.route("**/v1/predictions?*", answer)
    open_page(witness, service)
    rows, older = page.locator("#runs-table tbody tr"), page.get_by_role("button", name="Show older runs")
    expect(rows).to_have_count(8)
    older.click()
    expect(rows).to_have_count(11)
    expect(older).to_be_hidden()


# --- for everyone ---


@pytest.mark.parametrize("size", [PHONE, NARROW], ids=["phone", "narrow"])
def test_a_phone_scrolls_down_only(service, witness, size):
    with_calibration(witness.page)
    page = open_page(witness, service, size=size, with_scene=size == PHONE)
    expect(page.locator("#plot svg")).to_be_visible()
    if size == PHONE:
        expect(page.frame_locator("#scene").locator("canvas").first).to_be_visible()
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]


def test_the_page_can_be_walked_through_by_keyboard(service, witness):
    page = open_page(witness, service)

    def focused() -> str:
        press = "e => e.ariaLabel ?? e.textContent.trim()"
        page.keyboard.press("Tab")
        return page.evaluate(f"({press})(document.activeElement)")

    assert [focused() for _ in range(8)] == [
        "Skip the scene",
        "dlo, start page",
        "Gallery",
        "Speed",
        "Runs",
        "Use it",
        "API",
        "Dark theme",
    ]
    page.locator(".skip").focus()
    page.keyboard.press("Enter")
    first, second = list(examples().values())[:2]
    assert focused().startswith(first.title)
    assert focused() == f"{first.title}, as JSON"
    assert focused().startswith(second.title)
    page.keyboard.press("Enter")
    wait_for_scene(page, f"/scene/?example={second.name}")


def test_what_has_the_focus_is_outlined(service, witness):
    page = open_page(witness, service)
    for _ in range(8):
        page.keyboard.press("Tab")
        width = page.evaluate("parseFloat(getComputedStyle(document.activeElement).outlineWidth)")
        assert width >= 2  # [px], as WCAG 2.2 asks of an indicator


def test_the_theme_can_be_chosen_and_stays(service, witness):
    page = open_page(witness, service)
    ground = "getComputedStyle(document.body).backgroundColor"
    light = page.evaluate(ground)
    button = page.get_by_role("button", name="Dark theme")
    expect(button).to_have_attribute("aria-pressed", "false")
    button.click()
    expect(button).to_have_attribute("aria-pressed", "true")
    wait_for_scene(page, "/scene/?example=paper-25&darkMode")
    assert page.evaluate(ground) != light
    page.reload()
    expect(button).to_have_attribute("aria-pressed", "true")
    assert page.evaluate(ground) != light
    button.click()
    assert page.evaluate(ground) == light


def test_another_theme_leaves_a_scene_that_was_changed_as_it_is(service, witness):
    page = open_page(witness, service)
    wait_for_scene(page, "/scene/?example=paper-25")
    page.evaluate("document.getElementById('scene').contentWindow.changed = true")
    page.locator("#scene").click(position={"x": 200, "y": 200})
    button, note = page.get_by_role("button", name="Dark theme"), page.locator("#stage-note")
    button.click()
    expect(note).to_be_visible()
    expect(page.locator("#full")).to_have_attribute("href", re.compile("darkMode"))
    page.wait_for_timeout(300)
    assert page.evaluate("document.getElementById('scene').contentWindow.changed") is True
    button.click()
    expect(note).to_be_hidden()
    button.click()
    page.get_by_role("link", name=examples()["two-grippers"].title).first.click()
    wait_for_scene(page, "/scene/?example=two-grippers&darkMode")
    expect(note).to_be_hidden()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_has_the_contrast_of_wcag_aa(service, witness, scheme):
    page = open_page(witness, service, scheme=scheme)
    for text in ("--text", "--muted", "--accent", "--warning"):
        for ground in ("--ground", "--raised", "--code"):
            assert contrast(page, text, ground) >= 4.5, (text, ground)  # WCAG 2.2, 1.4.3


def contrast(page: Page, text: str, ground: str) -> float:
    """Return the contrast of two colours of the style sheet as WCAG 2.2 defines it."""
    colours = page.evaluate(
        """names => names.map(name => {
          const probe = document.body.appendChild(document.createElement("i"));
          probe.style.color = `var(${name})`;
          const colour = getComputedStyle(probe).color;
          probe.remove();
          return colour.match(/[0-9.]+/g).slice(0, 3).map(Number);
        })""",
        [text, ground],
    )
    one, other = sorted(luminance(colour) for colour in colours)
    return (other + 0.05) / (one + 0.05)


def luminance(colour: list[float]) -> float:
    parts = [c / 255 for c in colour]
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def test_the_examples_on_the_page_work(service, witness, tmp_path):
    page = open_page(witness, service)
    python, curl = page.locator("#python").inner_text(), page.locator("#curl").inner_text()
    script = tmp_path / "example.py"
    script.write_text(f"import sys; sys.path.insert(0, {str(service.root)!r})\n{python}\nprint(q.shape)")
    printed = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True).stdout
    assert "(33, 101, 4)" in printed
    body = re.search(r"-d '(.*)'", curl, re.DOTALL)
    address = re.search(r"http\S+", curl)
    assert body is not None
    assert address is not None
    answer = httpx.post(address[0], json=json.loads(body[1]))
    assert answer.json()["status"] == "converged"
