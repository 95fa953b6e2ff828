"""`friso app` in a real browser, on the thesis rig: what a user does, and what he sees."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import BROWSER, needs_browser
from log_files import motion, write_text
from made_up import both_joints, check_html
from patience import LIMIT
from test_map_views import page_of, plain

import friso
from friso.app.frames import frame
from friso.escapes import escaped
from friso.shown.blocks import AnswerBlock
from friso.shown.drawing.figure import Axis, Figure, Panel, Series
from friso.shown.drawing.palette import INK
from friso.shown.pages import Report

pytestmark = [needs_browser, pytest.mark.usefixtures("own_bandwidth")]

RIG = Path(friso.example("thesis_rig"))
SERVER = """
from friso.hunting import verdict
from friso.hunting.margin import NOT_SOUGHT

verdict.search_bandwidths = lambda *how: NOT_SOUGHT

from friso.cli import main

main()
"""
"""friso, whose checks search no other bandwidths (`own_bandwidth`)."""

ROW = '[data-path="controller.crossover"]'
FIELD = f"{ROW} input[type=text]"
CHANGES = "async () => (await import('/state.js')).changes()"
CHANGE = "async changes => (await import('/state.js')).set(changes)"


CHANNELS = ("time [s]", "position [m]", "force [N]")


def written(folder: Path, name: str = "log.csv", channels: Sequence[str] = CHANNELS, unit: float = 1.0) -> Path:
    """A log, its positions in a `unit` [m]."""
    moved = motion()
    columns = [np.asarray(moved["time"]), np.asarray(moved["position"]) / unit, np.asarray(moved["force"])]
    return write_text(folder / name, list(channels), columns)


def violations(page: Any) -> list[tuple[str, list[str]]]:
    """What axe finds wrong on a page."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    return [(one["id"], [node["html"] for node in one["nodes"]]) for one in axe.run(page).response["violations"]]


class Browsed:
    """The page, and what went wrong in it or left this machine."""

    def __init__(self, page: Any, token: str, address: str) -> None:
        self.page, self.token, self.address = page, token, address
        self.wrong: list[str] = []
        self.outside: list[str] = []
        page.on(
            "console", lambda message: self.wrong.append(message.text) if message.type in ("error", "warning") else 0
        )
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("request", lambda request: self._note(request.url))

    def _note(self, url: str) -> None:
        if not url.startswith((self.address, "data:", "blob:")):
            self.outside.append(url)

    def type(self, key: str, text: str) -> None:
        """A value is typed into the field of a key, by the keyboard alone."""
        self.page.focus(f'[data-path="{key}"] input[type=text]')
        self.page.keyboard.press("Control+a")
        self.page.keyboard.type(text)
        self.page.keyboard.press("Enter")

    def type_meanwhile(self, text: str, more: str) -> None:
        """A crossover is typed, and more before its answer comes and is drawn."""
        page, held = self.page, []
        page.route("**/ask/machine", lambda route: held.append(route))
        try:
            with page.expect_request(re.compile("ask/machine")):
                self.type("controller.crossover", text)
            page.keyboard.press("Control+a")
            page.keyboard.type(more)
            with page.expect_response(re.compile("ask/machine")):
                held.pop().continue_()
            page.wait_for_timeout(300)
        finally:
            page.unroute("**/ask/machine")

    def changes(self) -> dict[str, Any]:
        """Return the changed keys of the machine shown."""
        return self.page.evaluate(CHANGES)

    def change(self, changes: dict[str, Any]) -> None:
        """Keys are set."""
        self.page.evaluate(CHANGE, changes)

    def add(self, name: str, text: str | None = None) -> None:
        """Open another machine: the rig, unless its text is given."""
        of_rig = RIG.read_text(encoding="utf-8") if text is None else text
        self.page.evaluate("async ([name, text]) => (await import('/state.js')).add(name, text)", [name, of_rig])

    def no_logs(self) -> None:
        """Show the logs, of which none is left by the previous test."""
        self.page.click("#tab-logs")
        while (others := self.page.locator("#picture .files button, #picture button:text-is('Other files')")).count():
            others.first.click()

    def answered(self, text: str) -> None:
        """Wait until the answer has a text."""
        self.page.wait_for_function(
            "text => document.getElementById('answer').innerText.includes(text)", arg=text, timeout=1000 * LIMIT
        )

    def begin(self) -> None:
        """Show the rig alone, as it was opened, whatever the previous test left."""
        page = self.page
        page.unroute_all(behavior="ignoreErrors")
        page.context.set_offline(False)
        page.mouse.move(0, 0)
        page.mouse.up()
        page.set_viewport_size({"width": 1600, "height": 1000})
        page.emulate_media(color_scheme="light")
        page.evaluate(
            """async text => {
                const machines = await import('/state.js');
                document.getElementById('dialog').close();
                document.getElementById('keys').replaceChildren();
                machines.state.machines.length = 0;
                machines.state.pinned = null;
                machines.add('thesis_rig.toml', text);
            }""",
            RIG.read_text(encoding="utf-8"),
        )
        page.wait_for_selector("#keys h2")
        page.click("[data-part=controller]")
        page.click("#tab-run")
        page.wait_for_selector("#picture .js-plotly-plot .main-svg")

    def check(self, crossover: str) -> None:
        """A crossover is typed, and the whole answer is there."""
        self.type("controller.crossover", crossover)
        self.answered(first_sentence(crossover))

    def set(self, changes: dict[str, Any]) -> None:
        """Keys are set, and the picture of their run is there."""
        self.change(changes)
        self.says(friso.simulate(RIG, set=changes).sentences()[0])

    def says(self, text: str) -> None:
        """Wait until the picture has a text."""
        self.page.wait_for_function(
            "text => document.getElementById('picture').innerText.includes(text)", arg=text, timeout=1000 * LIMIT
        )


@cache
def first_sentence(crossover: str) -> str:
    """Return the first sentence of the whole answer about the rig with this crossover."""
    return friso.check(RIG, set={"controller.crossover": crossover}).sentences()[0]


@pytest.fixture(scope="module")
def opened() -> Iterator[Browsed]:
    driver = pytest.importorskip("playwright.sync_api")
    command = [sys.executable, "-c", SERVER, "app", str(RIG), "--no-browser", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server, driver.sync_playwright() as play:
        try:
            assert server.stdout is not None
            address = re.search(r"(http://\S+/)\?\S+", server.stdout.readline())
            assert address is not None
            chromium = play.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", "--disable-gpu"])
            page = chromium.new_context().new_page()
            page.set_default_timeout(1000 * LIMIT)
            opened = Browsed(page, *address.group(0, 1))
            page.goto(address[0])
            page.wait_for_selector("[data-part=controller]")
            yield opened
            chromium.close()
        finally:
            server.terminate()


@pytest.fixture
def browsed(opened: Browsed) -> Browsed:
    """The page as it begins: no test rests on another one."""
    opened.begin()
    return opened


def test_the_verdict_of_the_locked_rig_changes_at_its_edge(browsed: Browsed) -> None:
    """9.75 Hz, where the cycle stops attracting; undo takes it back."""
    page = browsed.page
    page.focus("[data-part=lock]")
    page.keyboard.press("Space")
    browsed.answered("Locked (as given): hunts")
    browsed.type("controller.crossover", "9.7 Hz")
    browsed.answered("Locked (as given): hunts")
    browsed.type("controller.crossover", "12 Hz")
    browsed.answered("Locked (as given): settles")
    page.keyboard.press("Tab")
    page.click("#undo")
    browsed.answered("Locked (as given): hunts")
    page.wait_for_function(f"() => document.querySelector('{FIELD}').value === '9.7 Hz'")


@pytest.mark.slow
def test_the_verdict_is_asked_for_where_the_run_is_left_before_it_answers(browsed: Browsed) -> None:
    page = browsed.page

    def about_it(question: str) -> Callable[[Any], bool]:
        return lambda request: f"ask/{question}" in request.url and "11 Hz" in (request.post_data or "")

    page.route("**/ask/run", lambda route: None if about_it("run")(route.request) else route.continue_())
    with page.expect_request(about_it("verdict")):
        with page.expect_request(about_it("run")):
            browsed.type("controller.crossover", "11 Hz")
        page.click("#tab-bode")


@pytest.mark.slow
def test_what_is_of_an_earlier_machine_is_shown_as_one(browsed: Browsed) -> None:
    """Old pictures and verdicts are marked if the new ones take longer than a moment, as with a kernel to compile."""
    page, runs, verdicts = browsed.page, [], []
    page.wait_for_selector("#answer .rest .note")
    page.wait_for_selector("#picture .figure:not(.old, [inert])")
    assert page.locator("#answer .old").count() == 0
    page.route("**/ask/check", lambda _: None)
    page.route("**/ask/verdict", lambda route: verdicts.append(route))
    page.route("**/ask/run", lambda route: runs.append(route))
    with page.expect_request("**/ask/verdict"):
        with page.expect_request("**/ask/run"):
            browsed.type("controller.crossover", "9 Hz")
        page.wait_for_selector("#picture .figure.old[inert]")
        runs[0].continue_()
        page.wait_for_selector("#picture .figure:not(.old, [inert])")
    page.wait_for_selector("#answer .old .case")
    page.wait_for_selector("#answer .rest.old[inert]")
    assert "controller.crossover as opened" in page.inner_text("#answer-part .older")
    verdicts[0].continue_()
    page.wait_for_selector("#answer :not(.old) > .case")
    assert page.locator("#answer .rest.old[inert]").count() == 1  # the advice is of no check of this machine
    page.click("#undo")
    page.wait_for_selector("#answer .rest:not(.old, [inert])")
    page.wait_for_function("() => document.querySelector('#left .older').innerText === ''")


@pytest.mark.slow
def test_the_pictures_of_an_answer_that_is_there_are_not_asked_for_again(browsed: Browsed) -> None:
    """Another check would take away the probability of hunting, which took minutes."""
    page, asked = browsed.page, []
    browsed.check("9.5 Hz")
    page.on("request", lambda request: asked.append(request.url))
    page.click("#tab-check")
    page.wait_for_selector("#picture .main-svg")
    assert not [address for address in asked if "ask/check" in address]


@pytest.mark.slow
def test_what_is_being_typed_stays_when_an_answer_comes(browsed: Browsed) -> None:
    """What was selected to be typed over stays selected, and a refusal is said meanwhile."""
    page, machine = browsed.page, re.compile("ask/machine")
    browsed.type_meanwhile("11 Hz", "10.5 H")
    page.keyboard.type("z")
    with page.expect_response(machine) as answered:
        page.keyboard.press("Enter")
    assert "10.5 Hz" in (answered.value.request.post_data or "")
    browsed.type_meanwhile("12 Hz", "")
    assert page.eval_on_selector(FIELD, "field => field === document.activeElement && field.value") == "12 Hz"
    page.keyboard.type("9.5 Hz")
    assert page.input_value(FIELD) == "9.5 Hz"
    with page.expect_response(machine):
        page.keyboard.press("Enter")
    browsed.type_meanwhile("3 kg", "10.")
    assert "convertible to Hz" in page.inner_text(f"{ROW} [role=alert]")
    page.keyboard.type("5 Hz")
    page.keyboard.press("Enter")
    page.wait_for_selector(f"{ROW} .wrong", state="detached")
    assert browsed.changes()["controller.crossover"] == "10.5 Hz"


@pytest.mark.slow
def test_the_first_click_after_typing_counts(browsed: Browsed) -> None:
    """Parts that are redrawn while the pointer is pressed are redrawn after the click; the focus stays."""
    page = browsed.page

    def click(place: str) -> None:
        page.hover(place)
        page.mouse.down()
        page.wait_for_timeout(300)  # a slow hand: answers come meanwhile
        page.mouse.up()

    browsed.type_meanwhile("11 Hz", "12 Hz")
    page.keyboard.press("Control+a")
    page.keyboard.type("11 Hz")  # nothing to hand over
    old = page.query_selector(FIELD)
    assert old is not None
    click("#keys-controller")
    page.wait_for_function("field => !field.isConnected", arg=old)
    assert page.locator("details[data-table=controller]").get_attribute("open") is not None
    assert page.evaluate("document.activeElement.id") == "keys-controller"
    page.click("#keys-controller")
    page.focus(FIELD)
    page.keyboard.press("Control+a")
    page.keyboard.type("10 Hz")
    click("[data-part=stage]")
    page.wait_for_selector('[data-path="masses.stage"]')
    page.click("[data-part=controller]")
    assert page.input_value(FIELD) == "10 Hz"


@pytest.mark.slow
def test_tabs_keep_the_focus_and_a_click_on_one_counts_while_a_value_is_handed_over(browsed: Browsed) -> None:
    """The answer stands above the tabs, and would move them from under the pointer: none comes to another machine."""
    page = browsed.page
    for question in ("verdict", "check"):
        page.route(f"**/ask/{question}", lambda _: None)
    page.evaluate(
        "async text => (await import('/state.js')).add('other.toml', text, false, {'controller.crossover': '9.5 Hz'})",
        RIG.read_text("utf-8"),
    )
    page.wait_for_function(f"() => document.querySelector('{FIELD}')?.value === '9.5 Hz'")
    page.focus("#tab-check")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "tab-check"
    page.focus(FIELD)
    page.keyboard.press("Control+a")
    page.keyboard.type("11 Hz")
    page.hover("#tab-logs")
    with page.expect_response("**/ask/machine"):
        page.mouse.down()
    assert browsed.changes()["controller.crossover"] == "11 Hz"
    page.mouse.up()
    page.wait_for_selector("#tab-logs[aria-selected=true]")


@pytest.mark.slow
def test_arrows_home_and_end_lead_along_the_tabs_of_which_tab_reaches_one(browsed: Browsed) -> None:
    page, tabs = browsed.page, "#pictures-bar [role=tab]"
    names = page.eval_on_selector_all(tabs, "all => all.map(tab => tab.id)")
    page.focus(f"#{names[0]}")
    reached = []
    for key in ("ArrowLeft", "ArrowRight", "End", "Home", "ArrowRight"):
        page.keyboard.press(key)
        reached.append(page.evaluate("document.activeElement.id"))
    assert reached == [names[-1], names[0], names[-1], names[0], names[1]]
    page.keyboard.press("Enter")
    page.wait_for_selector(f"#{names[1]}[aria-selected=true]")
    stops = page.eval_on_selector_all(tabs, "all => all.filter(tab => tab.tabIndex === 0).map(tab => tab.id)")
    assert stops == [names[1]]


@pytest.mark.slow
def test_machines_are_closed_by_keys_and_the_last_one_stays(browsed: Browsed) -> None:
    """The tabs own nothing but tabs, with which axe and screen readers agree; the one that follows has the focus."""
    page = browsed.page
    assert page.is_disabled("#close")
    for name in ("second.toml", "third.toml"):
        browsed.add(name)
    assert page.eval_on_selector_all("#machines > *", "all => all.map(one => one.role)") == ["tab"] * 3
    # figures of the last machine: the keys, whose heading stands above, are drawn before them
    page.wait_for_selector("#picture .figure:not(.old, [inert])")
    page.wait_for_selector("#keys h2")
    assert violations(page) == []
    page.focus("#machine-1")
    page.keyboard.press("Delete")
    assert page.inner_text("#machines").split() == ["thesis_rig", "third"]
    page.focus("#close")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.textContent") == "thesis_rig"
    page.keyboard.press("Delete")
    assert page.locator("#machines [role=tab]").count() == 1


@pytest.mark.slow
def test_an_answer_that_comes_before_its_picture_is_kept_as_an_earlier_one(browsed: Browsed) -> None:
    page, held = browsed.page, []
    page.route("**/ask/run", lambda route: held.append(route))
    browsed.change({"controller.crossover": "13 Hz"})
    page.wait_for_selector("#history [title*='13 Hz']")
    assert held
    held.pop().continue_()


@pytest.mark.slow
def test_earlier_answers_are_named_by_what_changed_and_lead_back_to_their_machine(browsed: Browsed) -> None:
    """They are one stop of the tab key; the machine returns with the keys of that time alone, in its own tab."""
    page, places = browsed.page, "#history button"
    names: dict[str, dict[str, str]] = {
        "as opened": {},  # whose answer may not come after the next one
        "controller.crossover 11 Hz": {"controller.crossover": "11 Hz"},
        "masses.cart 1.3 kg": {"masses.cart": "1.3 kg"},
        "controller.crossover 9 Hz, masses.cart 1.4 kg": {"controller.crossover": "9 Hz", "masses.cart": "1.4 kg"},
    }
    latest = "name => document.querySelector('#history button').title.startsWith(`thesis_rig, ${name}: `)"
    for name, changes in names.items():
        browsed.change(changes)
        page.wait_for_function(latest, arg=name)
    page.focus(f"{places}[tabindex='0']")
    page.keyboard.press("End")
    assert page.evaluate("document.activeElement === document.getElementById('history').lastChild")
    stops = page.eval_on_selector_all(places, "all => all.map(one => one.tabIndex)")
    assert stops == [*([-1] * (len(stops) - 1)), 0]
    browsed.add("another.toml")
    page.click("#history [title*='11 Hz']")
    page.wait_for_selector("#machine-0[aria-selected=true]")
    assert browsed.changes() == {"controller.crossover": "11 Hz"}


@pytest.mark.slow
def test_no_single_key_acts_on_the_page_and_a_pinned_machine_stays_as_a_ghost(browsed: Browsed) -> None:
    """Who speaks to the computer would set single keys off; WCAG 2.2, 2.1.4."""
    page, pinned = browsed.page, "async () => Boolean((await import('/state.js')).pinned())"
    page.focus("#picture")
    page.keyboard.press("p")
    assert page.evaluate(pinned) is False
    page.keyboard.press("Alt+p")
    assert page.evaluate(pinned) is True
    ghost = "document.querySelector('.plot').data.some((line) => line.name === 'pinned')"
    page.wait_for_function(f"() => {ghost}")
    page.click("#pin")
    page.wait_for_function(f"() => !({ghost})")


@pytest.mark.slow
def test_a_server_that_is_gone_is_said_so_and_nothing_is_lost(browsed: Browsed) -> None:
    page, wrong = browsed.page, len(browsed.wrong)
    page.context.set_offline(True)
    browsed.type("controller.crossover", "11 Hz")
    page.wait_for_selector("#trouble:not([hidden])")
    page.context.set_offline(False)
    page.wait_for_selector("#trouble", state="hidden")
    browsed.says(friso.simulate(RIG, set={"controller.crossover": "11 Hz"}).sentences()[0])
    assert all("ERR_INTERNET_DISCONNECTED" in text for text in browsed.wrong[wrong:])
    del browsed.wrong[wrong:]


@pytest.mark.slow
def test_what_was_typed_for_one_machine_is_not_set_in_another(browsed: Browsed, tmp_path: Path) -> None:
    page = browsed.page
    (tmp_path / "another.toml").write_text(friso.load(RIG).replace({"controller.crossover": "15 Hz"}).to_toml())
    page.focus(FIELD)
    page.keyboard.press("Control+a")
    page.keyboard.type("33 Hz")
    page.set_input_files("#file", tmp_path / "another.toml")
    page.wait_for_function(f"() => document.querySelector('{FIELD}').value.startsWith('15')")
    page.keyboard.press("Enter")
    assert browsed.changes() == {}
    page.click("#close")
    page.wait_for_function(f"() => document.querySelector('{FIELD}').value === '8 Hz'")
    assert browsed.changes() == {}


@pytest.mark.slow
def test_the_picture_follows_a_slider_which_goes_on_after_a_wrong_value(browsed: Browsed) -> None:
    """A corrected value does not take the slider from under the hand, and one pull is one step."""
    page, drawn = browsed.page, "document.querySelector('.plot').data.find((line) => line.name === 'Free (as given)')"
    last = f"JSON.stringify(Array.from({drawn}.y.slice(-40)))"
    browsed.type("controller.crossover", "3 kg")
    page.wait_for_selector(f"{ROW} .wrong")
    before = page.evaluate(last)
    slider = page.locator(f"{ROW} input[type=range]")
    same, width = slider.element_handle(), slider.evaluate("slider => slider.offsetWidth")
    slider.hover(position={"x": 0.6 * width, "y": 2})  # not where it stands: nothing would be set
    place = slider.bounding_box()
    assert place is not None
    height = place["y"] + 2
    try:
        with page.expect_request(
            lambda request: "ask/verdict" in request.url and "3 kg" not in (request.post_data or "")
        ):
            page.mouse.down()  # the verdict is asked for once the machine is right again
        assert same.evaluate("slider => slider.isConnected")
        there = page.input_value(FIELD)
        assert there not in ("8 Hz", "3 kg")
        page.mouse.move(place["x"] + 0.7 * place["width"], height, steps=3)
        assert page.input_value(FIELD) != there
        page.wait_for_function(f"before => {last} !== before", arg=before)
        assert page.eval_on_selector(FIELD, "field => field.value === field.defaultValue")  # nothing is being typed
        page.mouse.move(place["x"] + 0.7 * place["width"], height + 200)
    finally:
        page.mouse.up()
    page.wait_for_selector(f"{ROW} .wrong", state="detached")
    page.click("#undo")
    page.wait_for_selector(f"{ROW} .wrong")
    page.click("#undo")
    page.wait_for_selector(f"{ROW} .wrong", state="detached")
    page.wait_for_function(f"() => document.querySelector('{FIELD}').value === '8 Hz'")


@pytest.mark.thorough
def test_an_uncertain_value_has_no_slider_and_its_warning_stays(browsed: Browsed) -> None:
    page, row = browsed.page, '[data-path="masses.stage"]'
    page.click("[data-part=stage]")
    browsed.type("masses.stage", "0.5 kg .. 0.7 kg")
    page.wait_for_selector(f"{row} .uncertain")
    assert page.locator(f"{row} input[type=range]").count() == 0
    browsed.answered("1 key is uncertain (masses.stage)")
    drawn = re.compile('"draws":200')
    page.route("**/ask/check", lambda route: None if drawn.search(route.request.post_data or "") else route.continue_())
    with page.expect_request(lambda request: drawn.search(request.post_data or "") is not None):
        page.click("#draw")  # how probable is hunting
    page.click("#undo")
    page.wait_for_selector(f"{row} input[type=range]")
    page.click("[data-part=controller]")


@pytest.mark.slow
def test_the_exported_stage_gives_the_numbers_of_the_command_line(browsed: Browsed, tmp_path: Path) -> None:
    page = browsed.page
    browsed.set({"joint.locked": True, "controller.crossover": "9.7 Hz"})
    page.click("#out")
    with page.expect_download() as download:
        page.click("text=Stage file")
    download.value.save_as(tmp_path / "out.toml")
    line = page.inner_text("#dialog pre")
    page.keyboard.press("Escape")
    assert friso.load(tmp_path / "out.toml").controller.crossover == pytest.approx(9.7)
    assert line == 'friso simulate thesis_rig.toml --set joint.locked=true --set controller.crossover="9.7 Hz"'
    page.set_input_files("#file", tmp_path / "out.toml")
    page.wait_for_function("() => document.querySelectorAll('#machines [role=tab]').length > 1")
    browsed.says(friso.simulate(tmp_path / "out.toml").sentences()[0])


@pytest.mark.slow
def test_the_map_shows_the_run_under_the_pointer_and_a_click_sets_the_machine_there(browsed: Browsed) -> None:
    page = browsed.page
    page.click("#tab-map")
    finest = "() => document.querySelector('.plot')?.data?.some((one) => one.z?.length === 21)"
    page.wait_for_function(finest)  # a finer map under the pointer takes its run away
    page.wait_for_selector(".plot .heatmaplayer image")
    place = page.locator(".plot .nsewdrag").first.bounding_box()
    assert place is not None
    page.mouse.move(place["x"] + 0.8 * place["width"], place["y"] + 0.4 * place["height"])
    page.mouse.move(place["x"] + 0.8 * place["width"], place["y"] + 0.5 * place["height"])
    page.wait_for_selector("#beside .main-svg")  # the run of the cell under the pointer
    page.mouse.click(place["x"] + 0.8 * place["width"], place["y"] + 0.5 * place["height"])
    page.wait_for_function(f"() => document.querySelector('{FIELD}').value !== '8 Hz'")
    assert float(page.input_value(FIELD).split()[0]) > 15


@pytest.mark.slow
def test_an_answer_that_comes_once_another_machine_is_shown_is_not_taken_for_it(browsed: Browsed) -> None:
    page, held = browsed.page, []
    page.route("**/ask/machine", lambda route: route.continue_() if held else held.append(route))
    with page.expect_request(re.compile("ask/machine")):
        browsed.type("controller.crossover", "11 Hz")
    browsed.add("broken.toml", "masses = 3")
    held[0].continue_()
    page.wait_for_selector("text=Edit the file")
    assert page.locator(FIELD).count() == 0


@pytest.mark.slow
def test_what_stops_it_says_of_which_machine_and_gives_no_other_one_its_command(browsed: Browsed) -> None:
    page, held = browsed.page, []
    page.route("**/ask/tune", lambda route: held.append(route))
    page.click("#tab-remedies")
    with page.expect_request(re.compile("ask/tune")):
        page.click("#tune")
    browsed.change({"masses.cart": "1.3 kg"})
    said = {"sentences": ["Found."], "tables": [], "details": [], "failure": "", "notes": [], "figures": []}
    way = {"name": "isolator and gains", "toml": RIG.read_text(encoding="utf-8")}
    held[0].fulfill(body=frame({"kind": "answer", **said, "ways": [way], "command": "friso tune of the rig"}))
    page.wait_for_selector("text=Of thesis_rig.toml as it was opened")
    page.click("#out")
    assert "friso tune of the rig" not in page.inner_text("#dialog")
    page.keyboard.press("Escape")
    assert page.locator("[inert] >> text=Take over").count() == 1
    page.click("#undo")  # the machine that it is of is shown again
    page.click("text=Take over")
    page.wait_for_selector("#machine-1 >> text=isolator_and_gains")


@pytest.mark.slow
def test_a_picture_that_is_waited_for_says_so(browsed: Browsed) -> None:
    page = browsed.page
    page.route("**/ask/boundary", lambda _: None)
    page.click("#tab-boundary")
    page.wait_for_selector("#picture progress")
    page.click("#tab-bode")
    page.wait_for_selector("#picture .main-svg")
    page.wait_for_selector("#picture progress", state="detached")  # once its words are there, too


@pytest.mark.slow
def test_of_a_file_that_is_refused_no_other_machine_is_shown(browsed: Browsed, tmp_path: Path) -> None:
    """The refused file's text can be corrected on the page."""
    page = browsed.page
    (tmp_path / "wrong.toml").write_text(RIG.read_text().replace('"8 Hz"', '"8 kg"'))
    page.set_input_files("#file", tmp_path / "wrong.toml")
    browsed.answered("convertible to Hz")
    assert page.locator(".key, [data-part], .figure:visible, #pictures-bar button").count() == 0
    assert page.is_disabled("#out")
    assert page.is_disabled("#pin")
    page.set_input_files("#file", written(tmp_path))
    page.wait_for_selector("#role-position")
    assert page.locator("#pictures-bar button").count() == 0
    page.click("text=Edit the file")
    page.fill("#dialog textarea", RIG.read_text())
    page.click("text=Use this text")
    page.wait_for_selector(FIELD)
    assert page.input_value(FIELD) == "8 Hz"
    page.click("#tab-run")
    page.wait_for_selector("#picture .js-plotly-plot .main-svg")


@pytest.mark.slow
def test_where_the_server_fails_it_can_be_asked_again(browsed: Browsed, tmp_path: Path) -> None:
    page = browsed.page
    answer = json.dumps({"kind": "failed", "key": "", "text": "out of memory"}).encode()
    body = len(answer).to_bytes(4, "little") + bytes(4) + answer
    page.route("**/ask/machine", lambda route: route.fulfill(body=body))
    (tmp_path / "other.toml").write_text(RIG.read_text() + "\n")
    page.set_input_files("#file", tmp_path / "other.toml")
    browsed.answered("out of memory")
    page.unroute("**/ask/machine")
    page.click("text=Ask again")
    page.wait_for_selector(FIELD)
    page.wait_for_selector("#picture .js-plotly-plot .main-svg")


@pytest.mark.slow
def test_the_loops_follow_a_slider_and_what_they_allow_is_said_at_its_end(browsed: Browsed) -> None:
    page, slider = browsed.page, '[data-path="controller.crossover"] input[type=range]'
    page.click("#tab-bode")
    said = "() => document.getElementById('picture').innerText.includes('the loop is stable')"
    page.wait_for_function(said)
    with page.expect_response(re.compile("ask/loops")):
        page.eval_on_selector(slider, "one => { one.value = 300; one.dispatchEvent(new Event('input')); }")
    page.wait_for_function(f"() => !({said})()")
    assert page.locator(".figure:not(.old) .main-svg").count() > 0
    page.eval_on_selector(slider, "one => one.dispatchEvent(new Event('change'))")
    page.wait_for_function(said)
    page.wait_for_selector(".figure.old", state="detached")
    page.click("#undo")
    page.click("#tab-run")
    page.wait_for_selector("#picture .js-plotly-plot .main-svg")


@pytest.mark.slow
def test_of_a_log_that_says_nothing_roles_units_and_scales_are_told(browsed: Browsed, tmp_path: Path) -> None:
    """The page then asks for what the command line is given; a refusal names the dropped file."""
    page = browsed.page
    browsed.no_logs()
    page.set_input_files("#log-files", written(tmp_path, "mute.csv", "abc", 1e-3))
    page.wait_for_selector("#role-position")
    for role, channel, measure in (("time", "a", "s"), ("position", "b", "mm"), ("force", "c", "2 N/V")):
        for act, place, value in ((page.select_option, "role", channel), (page.fill, "measure", measure)):
            with page.expect_response("**/ask/logs"):
                act(f"#{place}-{role}", value)
                page.keyboard.press("Tab")
    page.wait_for_function("() => !document.getElementById('picture').innerText.includes('open:')")
    with page.expect_request("**/ask/identify") as asked:
        page.click("#identify")
    options = asked.value.post_data_json["options"]
    assert options["map"] == {"time": "a", "position": "b", "force": "c"}
    assert (options["unit"], options["scale"]) == ({"a": "s", "b": "mm"}, {"force": "2 N/V"})
    page.click("#picture button:text-is('Stop')")
    with page.expect_response("**/ask/logs"):
        page.fill("#measure-position", "kg")
        page.keyboard.press("Tab")
    page.wait_for_selector("#picture .wrong")
    assert page.inner_text("#picture .wrong").startswith("mute.csv: unit")
    with page.expect_response(lambda response: response.request.method == "DELETE") as gone:
        page.click("#picture button:text-is('Other files')")
    assert gone.value.status == 204  # the server keeps it no longer


@pytest.mark.slow
def test_no_text_from_a_file_steers_the_page(browsed: Browsed, tmp_path: Path) -> None:
    """Control characters and overrides of the reading direction are written out, as friso writes them out elsewhere."""
    page = browsed.page
    every = "".join(map(chr, [*range(0xD800), *range(0xE000, 0x10000), *range(0xE0000, 0xE0080), 0x1F600]))
    assert page.evaluate("async (text) => (await import('/dom.js')).plain(text)", every) == escaped(every)
    browsed.no_logs()
    channels = ["time [s]", "\u202eposition\x1b[31m [m]", "force [N]"]
    page.set_input_files("#log-files", written(tmp_path, "steering.csv", channels))
    page.wait_for_function("() => document.getElementById('picture').innerText.includes('u202eposition')")
    shown = page.inner_text("body")
    assert escaped(shown) == shown


@pytest.mark.slow
def test_a_log_that_is_refused_can_be_removed(browsed: Browsed, tmp_path: Path) -> None:
    page = browsed.page
    browsed.no_logs()
    (tmp_path / "none.csv").write_text("no log at all")
    page.set_input_files("#log-files", tmp_path / "none.csv")
    page.wait_for_selector("#picture .wrong")
    page.set_input_files("#log-files", written(tmp_path))
    page.wait_for_selector("#picture .files >> text=log.csv")
    with page.expect_response(lambda response: response.request.method == "DELETE") as gone:
        page.click("[aria-label='Remove none.csv']")
    assert gone.value.status == 204
    page.wait_for_selector("#role-position")
    page.click("[aria-label='Remove log.csv']")
    assert page.locator("#picture .files, #role-position").count() == 0


@pytest.mark.slow
def test_out_holds_the_machine_that_is_shown_or_waits_for_it(browsed: Browsed, tmp_path: Path) -> None:
    """No stage file is offered as long as the server has not read the last input."""
    page, held, button = browsed.page, [], "#dialog button:text-is('Stage file')"
    cascade = Path(friso.example("twincat_cascade"))
    page.route("**/ask/machine", lambda route: held.append(route))
    for act, expected in (
        (lambda: browsed.type("controller.crossover", "33 Hz"), {"controller.crossover": 33.0}),
        (lambda: browsed.add(cascade.name, cascade.read_text(encoding="utf-8")), friso.load(cascade).flat()),
    ):
        with page.expect_request(re.compile("ask/machine")):
            act()
        page.click("#out")
        assert page.is_disabled(button)
        held.pop().continue_()
        with page.expect_download() as download:
            page.click(button)
        download.value.save_as(tmp_path / "out.toml")
        assert friso.load(tmp_path / "out.toml").flat().items() >= expected.items()
        page.keyboard.press("Escape")


@pytest.mark.slow
def test_the_drawing_of_another_machine_switches_nothing(browsed: Browsed) -> None:
    page, held = browsed.page, []
    page.route("**/ask/machine", lambda route: held.append(route))
    with page.expect_request(re.compile("ask/machine")):
        browsed.add("b.toml", RIG.read_text() + "\n")
    assert page.locator("#drawing svg, #keys input").filter(visible=True).count() == 0
    page.eval_on_selector("#part-lock", "one => one.dispatchEvent(new MouseEvent('click', { bubbles: true }))")
    assert page.evaluate("document.querySelector('#keys').inert && document.querySelector('#drawing').inert")
    assert browsed.changes() == {}
    held.pop().continue_()
    page.click("#part-lock")  # as soon as it is seen
    assert browsed.changes() == {"joint.locked": True}


@pytest.mark.slow
def test_no_progress_stays_of_what_was_abandoned(browsed: Browsed) -> None:
    page = browsed.page
    page.wait_for_selector("#answer .rest .note")
    # of the machine that is refused, the server may be asked once more
    page.route("**/ask/map", lambda route: route.continue_() if "8 kg" in (route.request.post_data or "") else None)
    with page.expect_request("**/ask/map"):
        page.click("#tab-map")
    page.wait_for_selector("#picture progress")
    progress = "async part => (await import('/answer.js')).progress(part, 'picture')"
    page.evaluate(progress, {"kind": "progress", "done": 1, "total": 9, "label": "map"})
    assert page.locator("#answer progress").count() == 1
    browsed.type("controller.crossover", "8 kg")
    page.wait_for_selector("#keys .wrong")
    page.wait_for_function("() => !document.querySelector('progress')")


@pytest.mark.slow
def test_two_logs_dropped_at_once_are_both_taken(browsed: Browsed) -> None:
    page = browsed.page
    page.evaluate("""() => {
        const lines = Array.from({ length: 50 }, (_, k) => `${k / 1000},${k % 7}`);
        const text = ["time [s],position [m]", ...lines].join("\\n");
        const dropped = new DataTransfer();
        for (const name of ["one.csv", "two.csv"]) dropped.items.add(new File([text], name));
        document.dispatchEvent(new DragEvent("drop", { dataTransfer: dropped, cancelable: true }));
    }""")
    page.wait_for_function("() => document.getElementById('picture').innerText.match(/one.csv[^]*two.csv/)")
    page.wait_for_function("() => document.querySelectorAll('#picture .plot, #picture table').length")


FILL = """() => {
    const left = () => 'x'.repeat(localStorage.getItem('other')?.length ?? 0);
    for (let size = 2 ** 23; size >= 1; size /= 2) {
        try {
            localStorage.setItem('other', left() + 'x'.repeat(size));
        } catch {
            // half as much
        }
    }
}"""
KEPT = "JSON.parse(localStorage.getItem(`friso-machines-${sessionStorage.friso}`)).machines[0]"


@pytest.mark.slow
def test_a_browser_whose_storage_is_full_is_said_so(browsed: Browsed) -> None:
    """Data of other tabs are removed first; if that is not enough, the message stays."""
    page = browsed.page
    try:
        page.evaluate("""() => {
            const other = (name) => name.startsWith('friso-machines-') && !name.endsWith(sessionStorage.friso);
            Object.keys(localStorage).filter(other).forEach((name) => localStorage.removeItem(name));
            localStorage.setItem('friso-machines-old', 'x'.repeat(1000));
        }""")
        page.evaluate(FILL)
        browsed.type("controller.crossover", "11 Hz")
        page.wait_for_function(f"() => {KEPT}.step === 1")
        assert page.evaluate("localStorage.getItem('friso-machines-old')") is None
        assert page.is_hidden("#trouble")
        page.evaluate(FILL)
        page.evaluate("""() => {
            localStorage.setItem('other', localStorage.getItem('other').slice(40));
            localStorage.setItem('friso-machines-old', '{"at": 1}');
        }""")
        numbers = {"controller.crossover": "12 Hz", "masses.cart": "1.3 kg", "masses.stage": "0.61 kg"}
        browsed.change(numbers | {"joint.locked": True})
        page.wait_for_selector("#trouble:has-text('storage of the browser is full')")
        assert page.evaluate("localStorage.getItem('friso-machines-old')") == '{"at": 1}'
        assert page.evaluate(f"{KEPT}.step") == 1
    finally:
        page.evaluate("['other', 'friso-machines-old'].forEach((name) => localStorage.removeItem(name))")
    browsed.type("controller.crossover", "13 Hz")
    page.wait_for_selector("#trouble", state="hidden")
    assert page.evaluate(f"{KEPT}.step") == 3


@pytest.mark.slow
def test_a_tab_that_is_opened_from_another_keeps_its_own(browsed: Browsed) -> None:
    """A copied tab begins with the mark by which the first tab keeps its data."""
    page = browsed.page
    browsed.change({"masses.cart": "1.3 kg"})
    with page.context.expect_page() as opening:
        page.evaluate("window.open(location.href)")
    other = opening.value
    try:
        other.wait_for_selector("[data-part=controller]")
        page.wait_for_function("mark => sessionStorage.friso !== mark", arg=other.evaluate("sessionStorage.friso"))
        for one, crossover in ((other, "9 Hz"), (page, "11 Hz")):
            one.evaluate(CHANGE, {"controller.crossover": crossover})
        for one, crossover in ((other, "9 Hz"), (page, "11 Hz")):
            one.reload()
            one.wait_for_selector("[data-part=controller]")
            assert one.evaluate(CHANGES) == {"masses.cart": "1.3 kg", "controller.crossover": crossover}
    finally:
        other.close()


@pytest.mark.slow
def test_a_link_is_opened_and_a_broken_one_does_no_harm(browsed: Browsed) -> None:
    page = browsed.page
    link = """changes => {
        const [machine] = JSON.parse(localStorage.getItem(`friso-machines-${sessionStorage.friso}`)).machines;
        const bytes = new TextEncoder().encode(JSON.stringify({ name: "linked.toml", text: machine.text, changes }));
        const packed = new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate-raw"));
        return new Response(packed).arrayBuffer().then((all) => {
            location.hash = btoa(Array.from(new Uint8Array(all), (byte) => String.fromCharCode(byte)).join(""))
                .replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
        });
    }"""
    page.evaluate(link, {"masses.cart": [1]})
    page.wait_for_selector("#trouble:not([hidden])")
    page.evaluate(link, None)
    page.wait_for_selector("text=linked")
    page.wait_for_selector("#trouble", state="hidden")
    page.reload()
    page.wait_for_selector("text=linked")
    page.wait_for_selector("[data-part=controller]")


@pytest.mark.slow
def test_a_link_that_is_clicked_on_another_site_is_opened(browsed: Browsed) -> None:
    """The link opens in a new tab, unknown to the server: the browser is let in, and its machine is shown."""
    page = browsed.page
    link = page.evaluate("async () => (await import('/state.js')).link()")
    other = page.context.new_page()
    try:
        mail = f"<a href='{link}'>the rig</a>"
        other.route("http://mail.example/*", lambda route: route.fulfill(body=mail, content_type="text/html"))
        other.goto("http://mail.example/")
        other.click("text=the rig")
        other.wait_for_selector("[data-part=controller]")
        assert other.url == browsed.address
        assert other.evaluate("async () => (await import('/state.js')).current().made") is True
    finally:
        other.close()


@pytest.mark.slow
def test_a_browser_that_has_not_opened_the_address_is_told_to(browsed: Browsed) -> None:
    """With the address the browser is let in, and so is the page that was open; the token leaves the address."""
    context = browsed.page.context.browser.new_context()
    try:
        page = context.new_page()
        page.goto(browsed.address)
        page.wait_for_selector("#trouble:has-text('open that address')")
        assert page.locator("[data-part]").count() == 0
        opened = context.new_page()
        opened.goto(browsed.token)
        for one in (opened, page):
            one.wait_for_selector("[data-part=controller]")
        page.wait_for_selector("#trouble", state="hidden")
        assert opened.url == browsed.address
        assert context.cookies() == []
    finally:
        context.close()


@pytest.mark.slow
def test_a_narrow_page_draws_what_is_there_otherwise_and_asks_nothing(browsed: Browsed) -> None:
    page, asked = browsed.page, []
    page.reload()
    page.wait_for_selector("#answer .rest .note")  # the whole verdict, which else is asked for behind the pictures
    page.click("#tab-map")
    page.select_option("#metric", "outcome")  # done in a moment
    page.wait_for_selector(".plot .heatmaplayer image")
    page.wait_for_function("() => document.querySelector('.plot').data.some((one) => one.z?.length === 21)")
    page.wait_for_selector("#picture progress", state="detached")
    page.on("request", lambda request: None if request.url.endswith("/begin") else asked.append(request.url))
    height = page.evaluate("document.querySelector('.plot').layout.height")
    page.set_viewport_size({"width": 400, "height": 900})
    page.wait_for_function("height => document.querySelector('.plot').layout.height > height", arg=height)
    assert asked == []


@pytest.mark.slow
def test_out_gives_the_lines_of_the_picture_that_is_shown(browsed: Browsed) -> None:
    """For a picture without an answer, and for logs, the lines are those of the answer above."""
    page = browsed.page
    page.wait_for_selector("#answer .rest .note")
    page.route("**/ask/boundary", lambda _: None)
    commands = {"run": "simulate", "bode": "bode", "logs": "check", "boundary": "check"}
    for tab, command in [*commands.items(), ("bode", "bode")]:
        page.click(f"#tab-{tab}")
        if tab in ("run", "bode"):
            page.wait_for_selector("#picture .main-svg")
        page.click("#out")
        assert page.inner_text("#dialog pre >> nth=0") == f"friso {command} thesis_rig.toml"
        assert page.inner_text("#dialog button:has-text('ZIP')").split()[-2] == command
        page.keyboard.press("Escape")


def long_report() -> str:
    """A page with tables and texts that scroll, as every command writes them."""
    lines = tuple(Series(np.arange(2.0), np.arange(2.0), f"a line with a long name, {k}", INK) for k in range(4))
    figure = Figure("f", "Lines", "", (Panel("A title", Axis("x", ""), Axis("y", ""), lines),))
    block = AnswerBlock(columns=["Locked"], rows=[("Verdict", ["hunts, " * 30])], draw=lambda: [figure])
    return Report("check", "Rig", [block], stage_file="name = 'a'\n" + "# " * 200).html()


PAGES = {
    "report": (long_report, 1),
    "check": (lambda: check_html(both_joints()), 7),
    "map": (lambda: page_of(plain()), 1),
}
"""Pages of commands, and the figures on each."""


@pytest.mark.cases(slow=2)
@pytest.mark.parametrize("command", PAGES)
def test_the_figures_of_a_page_are_drawn_for_its_width_and_axe_finds_no_violation(
    browsed: Browsed, tmp_path: Path, command: str
) -> None:
    html, figures = PAGES[command]
    (tmp_path / "page.html").write_text(html(), encoding="utf-8")
    page, wrong = browsed.page.context.browser.new_page(), []
    try:
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.set_viewport_size({"width": 1600, "height": 20_000})  # figures are drawn as one scrolls to them
        page.goto((tmp_path / "page.html").as_uri())
        page.wait_for_function("n => document.querySelectorAll('.js-plotly-plot').length == n", arg=figures)
        if command == "map":
            place = page.locator(".nsewdrag").bounding_box()
            page.mouse.move(place["x"] + 0.3 * place["width"], place["y"] + 0.3 * place["height"])  # of 4 by 5 cells
            page.wait_for_selector(".hoverlayer text")
            told = page.text_content(".hoverlayer text").replace(" ", "")  # without the breaks of its lines
            assert told.endswith("frisosimulate--cellmap.zarr13")
        if command == "report":
            height = page.evaluate("document.querySelector('.main-svg').clientHeight")
            page.set_viewport_size({"width": 400, "height": 900})
            page.wait_for_function("was => document.querySelector('.main-svg').clientHeight > was", arg=height)
            assert violations(page) == []
        assert wrong == []
    finally:
        page.close()


def lines_of(page: Any) -> list[str]:
    """Return the names of the lines in the first picture."""
    return page.evaluate("[...document.querySelector('#picture .plot').data].map((line) => line.name)")


@pytest.mark.slow
def test_a_pasted_table_has_a_name_of_its_own(browsed: Browsed) -> None:
    """Saved as thesis_rig.toml it would stand for the file that was opened."""
    page = browsed.page
    page.click("#keys-text")
    page.fill("#dialog textarea", RIG.read_text(encoding="utf-8").replace("8 Hz", "7 Hz"))
    page.click("#dialog >> text=Use this text")
    page.wait_for_selector("#machine-1[aria-selected=true]")
    assert page.inner_text("#machine-1") == "thesis_rig_2"
    page.wait_for_function(f"() => document.querySelector('{FIELD}').value === '7 Hz'")
    page.click("#out")
    with page.expect_download() as saved:
        page.click("#dialog >> text=Stage file")
    assert saved.value.suggested_filename == "thesis_rig_2.toml"
    page.keyboard.press("Escape")


@pytest.mark.slow
def test_conclusions_whose_verdicts_changed_go_and_so_does_what_is_of_another_machine(browsed: Browsed) -> None:
    page = browsed.page
    browsed.answered("The free joint stops the hunting.")
    page.route("**/ask/check", lambda _: None)
    browsed.type("controller.crossover", "12 Hz")
    browsed.answered("Locked: settles.")
    assert "stops the hunting" not in page.inner_text("#answer")
    page.route("**/ask/machine", lambda _: None)
    browsed.add("another.toml")
    page.wait_for_selector("#answer .other", state="attached")
    assert page.locator("#answer .case").first.is_hidden()


@pytest.mark.slow
def test_a_cure_is_one_button_and_can_be_taken_back(browsed: Browsed) -> None:
    page = browsed.page
    browsed.change({"joint.locked": True})
    page.wait_for_selector("#verdict strong.hunts")
    page.click("#verdict button:text-is('Free the joint')")
    page.wait_for_selector("#verdict strong.settles")
    assert browsed.changes() == {"joint.locked": False}
    page.click("#verdict button:text-is('Take back: Free the joint')")
    page.wait_for_selector("#verdict strong.hunts")
    assert browsed.changes() == {"joint.locked": True}


@pytest.mark.slow
def test_the_machine_is_dragged_on_its_map_which_stays(browsed: Browsed) -> None:
    page = browsed.page
    page.click("#tab-map")
    page.wait_for_selector(".handle")
    point, place = (page.locator(name).first.bounding_box() for name in (".handle", ".plot .nsewdrag"))
    middle = point["x"] + point["width"] / 2, point["y"] + point["height"] / 2
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(place["x"] + 0.2 * place["width"], middle[1], steps=4)
    page.wait_for_selector("#verdict strong:is(.hunts, .bistable)")
    page.wait_for_timeout(400)  # longer than what is old stands in colour
    assert page.locator("#picture .figure:is(.old, [inert])").count() == 0
    page.mouse.up()
    assert float(browsed.changes()["controller.crossover"].split()[0]) < 5
    page.click("#undo")
    page.wait_for_selector("#verdict strong.settles")
    page.focus(".handle")
    page.keyboard.press("ArrowRight")
    assert float(browsed.changes()["controller.crossover"].split()[0]) > 8


@pytest.mark.slow
def test_the_map_is_refined_once_the_check_has_ended(browsed: Browsed) -> None:
    """It takes no time from the check, and shows something before."""
    page, checks, maps = browsed.page, [], []
    page.click("#tab-map")
    page.select_option("#metric", "outcome")  # done in a moment
    page.route("**/ask/check", lambda route: checks.append(route))
    page.on("requestfinished", lambda request: maps.append(request.url) if "ask/map" in request.url else None)
    rows = "document.querySelector('.plot')?.data?.find((one) => one.z)?.z.length"
    with page.expect_request("**/ask/check"):
        browsed.change({"masses.stage": "0.52 kg"})
    page.wait_for_function(f"() => {rows} === 6")
    page.wait_for_function("() => !document.querySelector('.figure').inert")
    assert page.evaluate(rows) == 6
    checks[0].continue_()
    page.wait_for_function(f"() => {rows} === 21")
    assert len(maps) <= 2


@pytest.mark.slow
def test_a_slider_that_is_let_go_keeps_its_verdict(browsed: Browsed) -> None:
    page, asked = browsed.page, []
    page.wait_for_selector("#answer .rest .note")
    page.on("request", lambda request: asked.append(request.url.rpartition("/")[2]))
    place = page.locator(f"{ROW} input[type=range]").bounding_box()
    page.mouse.move(place["x"] + 0.7 * place["width"], place["y"] + 2)
    with page.expect_response("**/ask/verdict"):
        page.mouse.down()
    page.wait_for_function("() => !document.querySelector('#verdict .word').inert")
    with page.expect_request("**/ask/check"):
        page.mouse.up()
    assert asked.count("verdict") == 1


@pytest.mark.slow
def test_tracks_of_sliders_have_the_colours_of_verdicts(browsed: Browsed) -> None:
    page = browsed.page
    track = f"document.querySelector('{ROW} input[type=range]').style.getPropertyValue('--track')"
    page.wait_for_function(f"() => {track}.includes('#d55e00') && {track}.includes('#009e73')")


@pytest.mark.slow
def test_a_run_shows_the_error_first_with_the_joint_locked_and_free(browsed: Browsed) -> None:
    page = browsed.page
    page.wait_for_function("() => document.querySelector('.plot')?.layout?.yaxis.title.text.startsWith('Error')")
    assert {"Locked", "Free (as given)"} <= {*lines_of(page)[:2]}


@pytest.mark.slow
def test_a_logged_run_lies_over_the_simulated_one(browsed: Browsed, tmp_path: Path) -> None:
    page = browsed.page
    browsed.no_logs()
    page.set_input_files("#log-files", written(tmp_path))
    page.wait_for_selector("#identify")
    page.click("#tab-run")
    page.wait_for_function(
        "() => document.querySelector('#picture .plot')?.data?.some((line) => line.name === 'logged')"
    )
    browsed.no_logs()


@pytest.mark.slow
def test_on_a_narrow_page_verdict_and_a_small_picture_stay_above_the_sliders(browsed: Browsed) -> None:
    page = browsed.page
    page.wait_for_selector("#verdict strong")
    page.set_viewport_size({"width": 400, "height": 900})
    page.wait_for_selector("#small .main-svg")
    page.locator(f"{ROW} input[type=range]").scroll_into_view_if_needed()
    page.evaluate("document.querySelector('#keys').scrollIntoView()")
    glance, slider = (page.locator(name).bounding_box() for name in ("#glance", f"{ROW} input[type=range]"))
    assert glance["y"] >= 0
    assert glance["height"] < 300
    assert slider["x"] + slider["width"] <= 400
    assert page.locator("#small").is_visible()


@pytest.mark.slow
def test_bare_numbers_take_the_unit_that_is_shown(browsed: Browsed) -> None:
    page = browsed.page
    browsed.type("controller.crossover", "9")
    page.wait_for_function(f"() => document.querySelector('{FIELD}').value === '9 Hz'")
    assert browsed.changes() == {"controller.crossover": "9 Hz"}
    page.click("#tab-map")
    page.fill("#x-from", "3")
    page.keyboard.press("Tab")
    assert page.input_value("#x-from") == "3 Hz"
    page.click("#tab-remedies")
    page.fill("#within", "2")
    page.keyboard.press("Tab")
    assert page.input_value("#within") == "2 um"


@pytest.mark.slow
def test_a_server_that_ends_is_said_so_and_its_restart_is_found_again(browsed: Browsed) -> None:
    """The page asks nothing, and opens no other address."""
    command = [sys.executable, "-c", SERVER, "app", str(RIG), "--no-browser", "--port"]
    context = browsed.page.context.browser.new_context()
    with subprocess.Popen([*command, "0"], stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout is not None
        token = re.search(r"http://\S+", first.stdout.readline())
        assert token is not None
        page = context.new_page()
        page.goto(token[0])
        page.wait_for_selector("[data-part=controller]")
        first.terminate()
        page.wait_for_selector("#trouble:not([hidden])")
    port = re.search(r":(\d+)/", token[0])
    assert port is not None
    with subprocess.Popen([*command, port[1]], stdout=subprocess.PIPE, text=True) as second:
        try:
            page.wait_for_selector("#trouble", state="hidden")
            page.wait_for_selector("#verdict strong")
        finally:
            second.terminate()
            context.close()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_violation(browsed: Browsed, scheme: str) -> None:
    browsed.page.emulate_media(color_scheme=scheme)
    there = {"run": ".plot .main-svg", "map": ".plot .heatmaplayer image", "remedies": "#tune", "logs": ".drop"}
    for tab, content in there.items():
        browsed.page.click(f"#tab-{tab}")
        browsed.page.wait_for_selector(f"#picture {content}")
        assert violations(browsed.page) == []


def test_nothing_went_wrong_and_nothing_left_this_machine(opened: Browsed) -> None:
    """Check the errors and requests of the whole file; this test runs last."""
    assert (opened.wrong, opened.outside) == ([], [])
