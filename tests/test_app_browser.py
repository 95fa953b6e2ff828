"""`friso app` in a real browser, on the thesis rig: journeys of a user, each in a page of its own that begins anew."""

import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import BROWSER, needs_browser
from log_files import motion, write_text
from made_up import both_joints, check_html
from patience import LIMIT, wait_until
from test_map_views import page_of, plain

import friso
from friso.app.work import frame
from friso.errors import escaped
from friso.shown.blocks import AnswerBlock
from friso.shown.drawing.figure import INK, Axis, Figure, Panel, Series
from friso.shown.pages import Report

pytestmark = [needs_browser, pytest.mark.usefixtures("own_bandwidth")]

RIG = Path(friso.example("thesis_rig"))
TEXT = RIG.read_text(encoding="utf-8")
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
SLIDER = f"{ROW} input[type=range]"
CHANGES = "async () => (await import('/state.js')).changes()"
CHANGE = "async changes => (await import('/state.js')).set(changes)"
DRAWN = {
    "ball_screw_axis": ["screw, 10 mm", "velocity", "position", "20 kg", "Bearing: lugre"],
    "robot_wrist": ["encoder", "0.004 kg*m^2", "rigid", "0.002 kg*m^2", "Bearing: lugre"],
}
"""What stands in the drawing of a machine in small letters."""

CHANNELS = ("time [s]", "position [m]", "force [N]")
PICTURE = "#picture .js-plotly-plot .main-svg"


def written(folder: Path, name: str = "log.csv", channels: Sequence[str] = CHANNELS, unit: float = 1.0) -> Path:
    """A log, its positions in a `unit` [m]."""
    moved = motion()
    columns = [np.asarray(moved["time"]), np.asarray(moved["position"]) / unit, np.asarray(moved["force"])]
    return write_text(folder / name, list(channels), columns)


def violations(page: Any) -> list[tuple[str, list[str]]]:
    """What axe finds wrong on a page."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    return [(one["id"], [node["html"] for node in one["nodes"]]) for one in axe.run(page).response["violations"]]


class Held:
    """Questions of a page that do not reach the server until each is let go."""

    def __init__(self, page: Any, question: str, of: str = "") -> None:
        self.page, self.address, self.of = page, f"**/ask/{question}", of
        self.routes: list[Any] = []
        page.route(self.address, self._came)

    def _came(self, route: Any) -> None:
        if self.of in (route.request.post_data or ""):
            self.routes.append(route)
        else:
            route.continue_()

    def come(self) -> Any:
        """Wait for a question, and return its route."""
        wait_until(lambda: self.page.evaluate("0") or self.routes)
        return self.routes.pop(0)

    def end(self) -> None:
        """Later questions reach the server."""
        self.page.unroute(self.address)


class Browsed:
    """A page, what it asked, and what went wrong in it or left this machine."""

    def __init__(self, page: Any, token: str, address: str) -> None:
        self.page, self.token, self.address = page, token, address
        self.wrong: list[str] = []
        self.outside: list[str] = []
        self.asked: list[str] = []
        page.on(
            "console", lambda message: self.wrong.append(message.text) if message.type in ("error", "warning") else 0
        )
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("request", lambda request: self._note(request.url))

    def _note(self, url: str) -> None:
        if not url.startswith((self.address, "data:", "blob:")):
            self.outside.append(url)
        self.asked.append(url.removeprefix(self.address))

    def hold(self, question: str, of: str = "") -> Held:
        """Hold a question; `of`: only where its machine or its options have this text."""
        return Held(self.page, question, of)

    def write(self, text: str, key: str = "controller.crossover") -> None:
        """A value is written into the field of a key, by the keyboard alone, and not handed over yet."""
        self.page.focus(f'[data-path="{key}"] input[type=text]')
        self.page.keyboard.press("Control+a")
        self.page.keyboard.type(text)

    def type(self, text: str, key: str = "controller.crossover") -> None:
        """A value is typed into the field of a key."""
        self.write(text, key)
        self.page.keyboard.press("Enter")

    def type_meanwhile(self, text: str, more: str) -> None:
        """A crossover is typed, and more before the server has read it."""
        held = self.hold("machine")
        self.type(text)
        self.page.keyboard.press("Control+a")
        self.page.keyboard.type(more)
        held.come().continue_()
        self.read()
        held.end()

    def read(self) -> None:
        """Wait until the server has read the machine as it is set, or has refused it, and the page knows."""
        self.page.wait_for_function("async () => { await (await import('/shown.js')).now().read; return true; }")

    def field(self, text: str) -> None:
        """Wait until the field of the crossover has a value."""
        self.page.wait_for_function(
            "([field, text]) => document.querySelector(field)?.value === text", arg=[FIELD, text]
        )

    def changes(self) -> dict[str, Any]:
        """Return the changed keys of the machine shown."""
        return self.page.evaluate(CHANGES)

    def change(self, changes: dict[str, Any]) -> None:
        """Keys are set."""
        self.page.evaluate(CHANGE, changes)

    def crossover(self) -> float:
        """Return the crossover that is set [Hz]."""
        return float(self.changes()["controller.crossover"].split()[0])

    def add(self, name: str, text: str = TEXT, changes: dict[str, Any] | None = None) -> None:
        """Open another machine: the rig, unless its text is given."""
        add = "async ([name, text, changes]) => (await import('/state.js')).add(name, text, false, changes)"
        self.page.evaluate(add, [name, text, changes or {}])

    def show(self, tab: str, content: str = PICTURE) -> None:
        """Show the picture of a tab."""
        self.page.click(f"#tab-{tab}")
        self.page.wait_for_selector(content)

    def says(self, text: str, place: str = "answer") -> None:
        """Wait until a place, the answer, has a text."""
        says = "([place, text]) => document.getElementById(place).innerText.includes(text)"
        self.page.wait_for_function(says, arg=[place, text])

    def verdict(self, *words: str) -> None:
        """Wait until the verdict is one of these."""
        self.page.wait_for_selector(f"#verdict .word:not([inert]) strong:is({', '.join(f'.{word}' for word in words)})")

    def focused(self) -> str:
        """Return the id of what has the focus."""
        return self.page.evaluate("document.activeElement.id")

    def turn(self) -> None:
        """Whatever the page does after what is at work comes first."""
        self.page.evaluate("() => new Promise((done) => setTimeout(done))")

    def press(self, place: str) -> None:
        """The pointer is pressed on a place, where it is once nothing is drawn for the last place of the pointer."""
        for _ in range(2):
            self.page.hover(place)
        self.page.mouse.down()

    def download(self, path: Path) -> str:
        """Save the stage file of the dialog that is open, and return the name offered for it."""
        with self.page.expect_download() as saved:
            self.page.click("#dialog button:text-is('Stage file')")
        saved.value.save_as(path)
        self.page.keyboard.press("Escape")
        return saved.value.suggested_filename

    def restart(self) -> None:
        """Open the address anew, and show the run of the machine."""
        self.page.goto(self.token)
        self.page.wait_for_selector("[data-part=controller]")
        self.show("run")


@contextmanager
def serving(port: str = "0") -> Iterator[tuple[str, str]]:
    """The address of a server with its token, and without."""
    command = [sys.executable, "-c", SERVER, "app", str(RIG), "--no-browser", "--port", port]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            address = re.search(r"(http://\S+/)\?\S+", server.stdout.readline())
            yield address[0], address[1]
        finally:
            server.terminate()


@pytest.fixture(scope="module")
def served() -> Iterator[tuple[str, str]]:
    with serving() as address:
        yield address


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with pytest.importorskip("playwright.sync_api").sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", "--disable-gpu"])
        yield chromium
        chromium.close()


@contextmanager
def new_page(chromium: Any) -> Iterator[Any]:
    """A page of a browser that has kept nothing."""
    context = chromium.new_context(viewport={"width": 1600, "height": 1000})
    context.set_default_timeout(1000 * LIMIT)
    try:
        yield context.new_page()
    finally:
        context.close()


@contextmanager
def opened(chromium: Any, served: tuple[str, str], *held: str) -> Iterator[Browsed]:
    """A page that shows the run of the rig; nothing may go wrong in it, and nothing may leave this machine."""
    with new_page(chromium) as page:
        browsed = Browsed(page, *served)
        for question in held:
            browsed.hold(question)
        browsed.restart()
        yield browsed
    assert (browsed.wrong, browsed.outside) == ([], [])


@pytest.fixture
def browsed(chromium: Any, served: tuple[str, str]) -> Iterator[Browsed]:
    with opened(chromium, served) as browsed:
        yield browsed


@pytest.fixture
def unchecked(chromium: Any, served: tuple[str, str]) -> Iterator[Browsed]:
    """Its checks, which take most of the server's time, have no answer: verdicts are those of sliders."""
    with opened(chromium, served, "check") as browsed:
        yield browsed


@pytest.mark.slow
def test_ask(browsed: Browsed) -> None:
    """Answers are the command's, and none stays that no longer holds; a cure is one button, and can be taken back."""
    page = browsed.page
    browsed.says("The free joint stops the hunting.")
    held = browsed.hold("check")
    browsed.type("12 Hz")
    browsed.says("Locked: settles.")
    assert "stops the hunting" not in page.inner_text("#answer")  # concluded from other verdicts
    held.end()
    browsed.type("9.5 Hz")
    browsed.says(friso.check(RIG, set={"controller.crossover": "9.5 Hz"}).sentences()[0])
    page.wait_for_function(
        "row => document.querySelector(row).style.getPropertyValue('--track').includes('#d55e00')", arg=SLIDER
    )
    browsed.asked.clear()
    browsed.show("check")
    assert "ask/check" not in browsed.asked  # it may have taken minutes
    browsed.show("run")
    browsed.says(friso.simulate(RIG, set={"controller.crossover": "9.5 Hz"}).sentences()[0], "picture")
    browsed.change({"joint.locked": True})
    browsed.says("Locked (as given): hunts")
    page.click("#verdict button:text-is('Free the joint')")
    browsed.verdict("settles")
    assert page.inner_text("#verdict strong").lower() == "free: settles"
    assert browsed.changes()["joint.locked"] is False
    page.click("#verdict button:text-is('Take back: Free the joint')")
    browsed.says("Locked (as given): hunts")
    assert browsed.changes()["joint.locked"] is True


@pytest.mark.slow
def test_open(browsed: Browsed, tmp_path: Path) -> None:
    """Stage files come in and go out as they are; of one that is refused, the text can be mended on the page."""
    page = browsed.page
    (tmp_path / "wrong.toml").write_text(TEXT.replace('"8 Hz"', '"8 kg"'))
    page.set_input_files("#file", tmp_path / "wrong.toml")
    browsed.says("convertible to Hz")
    assert page.locator(".key, [data-part], .figure:visible, #pictures-bar button").count() == 0
    assert page.is_disabled("#out")
    assert page.is_disabled("#pin")
    page.click("text=Edit the file")
    page.fill("#dialog textarea", TEXT.replace("8 Hz", "7 Hz"))
    page.click("text=Use this text")
    browsed.field("7 Hz")
    for name, words in DRAWN.items():
        browsed.add(f"{name}.toml", Path(friso.example(name)).read_text(encoding="utf-8"))
        wait_until(lambda words=words: page.locator("#drawing .small").all_text_contents() == words)
        page.click("#close")
    browsed.field("7 Hz")
    page.click("#out")
    assert browsed.download(tmp_path / "out.toml") == "wrong_2.toml"  # it stands for no file that was opened

    held = browsed.hold("machine")
    browsed.change({"joint.locked": True, "controller.crossover": "9.7 Hz"})
    page.click("#out")
    assert page.is_disabled("#dialog button:text-is('Stage file')")  # the server has not read it
    held.come().continue_()
    held.end()
    browsed.download(tmp_path / "out.toml")
    assert (
        friso.load(tmp_path / "out.toml").flat().items() >= {"joint.locked": True, "controller.crossover": 9.7}.items()
    )
    page.set_input_files("#file", tmp_path / "out.toml")
    page.wait_for_selector("#machines >> text=out")
    browsed.show("run")
    browsed.says(friso.simulate(tmp_path / "out.toml").sentences()[0], "picture")

    browsed.says(friso.check(tmp_path / "out.toml").sentences()[0])
    browsed.hold("boundary")
    for tab, command in {"run": "simulate", "bode": "bode", "logs": "check", "boundary": "check"}.items():
        browsed.show(tab, PICTURE if tab in ("run", "bode") else f"#tab-{tab}[aria-selected=true]")
        page.click("#out")
        assert page.inner_text("#dialog pre >> nth=0") == f"friso {command} out.toml"
        page.keyboard.press("Escape")


@pytest.mark.slow
def test_edit(unchecked: Browsed) -> None:
    """What is typed is not lost, whatever comes meanwhile, and what is wrong is told at its field; undo takes back."""
    browsed = unchecked
    page = browsed.page
    browsed.hold("verdict")
    browsed.type("9")
    browsed.field("9 Hz")
    assert browsed.changes() == {"controller.crossover": "9 Hz"}
    page.select_option("#key-controller-kind", "transfer_function")
    page.wait_for_selector("#keys >> text=In the text")
    page.select_option("#key-controller-kind", "cascade")
    page.wait_for_function("() => document.querySelector('#key-controller-kv')?.value === '17.88 1/s'")
    page.select_option("#key-controller-kind", "pid by crossover")
    browsed.field("9 Hz")
    for _ in range(3):
        page.click("#undo")
    assert browsed.changes() == {"controller.crossover": "9 Hz"}
    browsed.field("9 Hz")
    browsed.type_meanwhile("11 Hz", "10.5 H")
    page.keyboard.type("z")
    page.keyboard.press("Enter")
    assert browsed.changes() == {"controller.crossover": "10.5 Hz"}
    browsed.type_meanwhile("12 Hz", "")  # selected to be typed over
    page.keyboard.type("9.5 Hz")
    assert page.input_value(FIELD) == "9.5 Hz"
    browsed.type_meanwhile("3 kg", "10.")
    assert "convertible to Hz" in page.inner_text(f"{ROW} [role=alert]")
    page.keyboard.type("5 Hz")
    page.keyboard.press("Enter")
    page.wait_for_selector(f"{ROW} .wrong", state="detached")
    assert browsed.changes() == {"controller.crossover": "10.5 Hz"}

    browsed.type_meanwhile("11 Hz", "12 Hz")  # the first click counts
    browsed.write("11 Hz")  # nothing to hand over
    old = page.query_selector(FIELD)
    browsed.press("#keys-controller")
    browsed.turn()
    page.mouse.up()
    page.wait_for_function("field => !field.isConnected", arg=old)
    assert page.locator("details[data-table=controller]").get_attribute("open") is not None
    assert browsed.focused() == "keys-controller"
    browsed.write("10 Hz")
    browsed.press("[data-part=stage]")
    browsed.read()
    page.mouse.up()
    page.wait_for_selector('[data-path="masses.stage"]')
    page.click("[data-part=controller]")
    browsed.field("10 Hz")
    browsed.write("11 Hz")
    browsed.press("#tab-logs")
    browsed.read()
    page.mouse.up()
    page.wait_for_selector("#tab-logs[aria-selected=true]")
    assert browsed.changes() == {"controller.crossover": "11 Hz"}
    browsed.show("run")

    browsed.type("3 kg")
    page.wait_for_selector(f"{ROW} .wrong")
    slider = page.wait_for_selector(SLIDER)
    box = slider.bounding_box()
    places = [box["x"] + part * box["width"] for part in (0.6, 0.7)]
    page.mouse.move(places[0], box["y"] + 2)
    page.mouse.down()
    browsed.read()
    assert slider.evaluate("slider => slider.isConnected")  # it is still under the hand
    there = page.input_value(FIELD)
    assert there not in ("11 Hz", "3 kg")
    page.mouse.move(places[1], box["y"] + 2, steps=3)
    assert page.input_value(FIELD) != there
    page.mouse.move(places[1], box["y"] + 200)
    page.mouse.up()
    page.wait_for_selector(f"{ROW} .wrong", state="detached")
    page.click("#undo")  # one pull is one step
    page.wait_for_selector(f"{ROW} .wrong")
    page.click("[data-part=stage]")
    page.reload()
    page.wait_for_selector(f"{ROW} .wrong")
    assert page.input_value(FIELD) == "3 kg"
    assert page.is_disabled("#out")
    page.click("#undo")
    page.wait_for_selector(f"{ROW} .wrong", state="detached")
    browsed.field("11 Hz")

    stable = "the loop is stable"
    browsed.show("bode")
    browsed.says(stable, "picture")
    page.eval_on_selector(SLIDER, "one => { one.value = 300; one.dispatchEvent(new Event('input')); }")
    page.wait_for_function("text => !document.getElementById('picture').innerText.includes(text)", arg=stable)
    page.eval_on_selector(SLIDER, "one => one.dispatchEvent(new Event('change'))")
    browsed.says(stable, "picture")


@pytest.mark.slow
def test_compare(browsed: Browsed, tmp_path: Path) -> None:
    """Whatever stands on the page says of which machine it is, as it was set; what is of another does nothing."""
    page = browsed.page
    page.wait_for_selector("#answer .rest .note")
    checks, verdicts, runs = (browsed.hold(question) for question in ("check", "verdict", "run"))
    browsed.type("9 Hz")
    page.wait_for_selector("#picture .figure.old[inert]")
    runs.come().continue_()
    page.wait_for_selector("#picture .figure:not(.old, [inert])")
    page.wait_for_selector("#answer .rest.old[inert]")
    assert "controller.crossover as opened" in page.inner_text("#answer-part .older")
    verdicts.come().continue_()
    page.wait_for_selector("#answer :not(.old) > .case")
    assert page.locator("#answer .rest.old[inert]").count() == 1  # the advice is of no check of this machine
    browsed.type("9.2 Hz")
    runs.come()
    page.click("#tab-bode")  # the run is left before it answers
    verdicts.come().continue_()
    browsed.show("run", "#tab-run[aria-selected=true]")
    for held in (checks, verdicts, runs):
        held.end()
    latest = "name => document.querySelector('#history button').title.startsWith(`thesis_rig, ${name}: `)"
    for name, changes in {
        "controller.crossover 11 Hz": {"controller.crossover": "11 Hz"},
        "masses.cart 1.3 kg": {"masses.cart": "1.3 kg"},
    }.items():
        browsed.change(changes)
        page.wait_for_function(latest, arg=name)

    page.click("#pin")
    browsed.change({"masses.cart": "1.4 kg"})
    ghost = "document.querySelector('#picture .plot').data.some((line) => line.name === 'pinned')"
    page.wait_for_function(f"() => {ghost}")
    page.click("#pin")
    page.wait_for_function(f"() => !({ghost})")

    machines = browsed.hold("machine")
    browsed.add("b.toml", f"{TEXT}\n")
    other = machines.come()
    assert page.locator("#drawing svg, #keys input, #answer .case").filter(visible=True).count() == 0
    page.eval_on_selector("#part-lock", "one => one.dispatchEvent(new MouseEvent('click', { bubbles: true }))")
    assert browsed.changes() == {}
    other.continue_()
    page.click("#part-lock")  # as soon as it is seen
    assert browsed.changes() == {"joint.locked": True}
    machines.come()
    browsed.add("broken.toml", "masses = 3")
    machines.end()
    page.click("#machine-0")
    page.click("#machine-2")
    page.wait_for_selector("text=Edit the file")
    assert page.locator(FIELD).count() == 0
    page.click("#history [title*='11 Hz']")
    page.wait_for_selector("#machine-0[aria-selected=true]")
    assert browsed.changes() == {"controller.crossover": "11 Hz"}

    browsed.field("11 Hz")
    browsed.write("33 Hz")
    browsed.add("another.toml", TEXT, {"controller.crossover": "15 Hz"})
    browsed.field("15 Hz")
    page.keyboard.press("Enter")
    assert browsed.changes() == {"controller.crossover": "15 Hz"}
    page.click("#machine-0")
    browsed.field("11 Hz")

    tune = browsed.hold("tune")
    page.click("#tab-remedies")
    page.fill("#within", "2")
    page.keyboard.press("Tab")
    assert page.input_value("#within") == "2 um"
    page.click("#tune")
    question = tune.come()
    browsed.change({"masses.cart": "1.3 kg"})
    said = {"sentences": ["Found."], "tables": [], "details": [], "failure": "", "notes": [], "figures": []}
    way = {"name": "isolator and gains", "toml": TEXT}
    question.fulfill(body=frame({"kind": "answer", **said, "ways": [way], "command": "friso tune of the rig"}))
    page.wait_for_selector("text=Of thesis_rig.toml with controller.crossover = 11 Hz")
    assert page.locator("[inert] >> text=Take over").count() == 1
    page.click("#out")
    assert "friso tune of the rig" not in page.inner_text("#dialog")
    page.keyboard.press("Escape")
    page.click("#undo")  # the machine that it is of is shown again
    page.click("text=Take over")
    page.wait_for_selector("#machines >> text=isolator_and_gains")


@pytest.mark.slow
def test_log(unchecked: Browsed, tmp_path: Path) -> None:
    """Logs are dropped, told what they do not say, laid over the run, and let go by the server too."""
    browsed = unchecked
    page = browsed.page
    page.evaluate("""() => {
        const lines = Array.from({ length: 50 }, (_, k) => `${k / 1000},${k % 7}`);
        const text = ["time [s],position [m]", ...lines].join("\\n");
        const dropped = new DataTransfer();
        for (const name of ["one.csv", "two.csv"]) dropped.items.add(new File([text], name));
        document.dispatchEvent(new DragEvent("drop", { dataTransfer: dropped, cancelable: true }));
    }""")
    page.wait_for_function("() => document.getElementById('picture').innerText.match(/one.csv[^]*two.csv/)")
    page.click("#picture button:text-is('Other files')")

    (tmp_path / "none.csv").write_text("no log at all")
    page.set_input_files("#log-files", tmp_path / "none.csv")
    page.wait_for_selector("#picture .wrong")
    page.set_input_files("#log-files", written(tmp_path))
    page.wait_for_selector("#picture .files >> text=log.csv")
    with page.expect_response(lambda response: response.request.method == "DELETE") as gone:
        page.click("[aria-label='Remove none.csv']")
    assert gone.value.status == 204
    page.wait_for_selector("#identify")
    page.click("#tab-run")
    page.wait_for_function(
        "() => document.querySelector('#picture .plot')?.data?.some((line) => line.name === 'logged')"
    )
    page.click("#tab-logs")
    page.click("[aria-label='Remove log.csv']")
    assert page.locator("#picture .files, #role-position").count() == 0

    page.set_input_files("#log-files", written(tmp_path, "mute.csv", "abc", 1e-3))
    page.wait_for_selector("#role-position")
    for role, channel, measure in (("time", "a", "s"), ("position", "b", "mm"), ("force", "c", "2 N/V")):
        page.select_option(f"#role-{role}", channel)
        page.fill(f"#measure-{role}", measure)
        page.keyboard.press("Tab")
    browsed.hold("identify")
    with page.expect_request("**/ask/identify") as asked:
        page.click("#identify")
    options = asked.value.post_data_json["options"]
    assert options["map"] == {"time": "a", "position": "b", "force": "c"}
    assert (options["unit"], options["scale"]) == ({"a": "s", "b": "mm"}, {"force": "2 N/V"})
    page.click("#picture button:text-is('Stop')")
    page.fill("#measure-position", "kg")
    page.keyboard.press("Tab")
    page.wait_for_selector("#picture .wrong")
    assert page.inner_text("#picture .wrong").startswith("mute.csv: unit")


@pytest.mark.slow
def test_map(browsed: Browsed) -> None:
    """The machine is a point on its map, which is dragged, and set by a click where the run of a cell is shown."""
    page = browsed.page
    rows = "document.querySelector('#picture .plot')?.data?.find((one) => one.z)?.z.length"
    check = browsed.hold("check")
    browsed.change({"masses.stage": "0.52 kg"})
    check.come().continue_()
    page.click("#tab-map")
    check.end()
    whole = "!document.querySelector('#picture h3').innerText.includes('first look')"
    page.wait_for_function(f"() => {rows} === 21 && {whole}")  # a finer map under the pointer takes its run away
    point, place = (page.wait_for_selector(name).bounding_box() for name in (".handle", ".plot .nsewdrag"))
    middle = point["x"] + point["width"] / 2, point["y"] + point["height"] / 2
    page.evaluate("""() => {
        const watch = () => (window.grey ||= document.querySelector('#picture .figure:is(.old, [inert])') !== null);
        const options = { subtree: true, childList: true, attributes: true };
        new MutationObserver(watch).observe(document.getElementById('picture'), options);
    }""")
    page.mouse.move(*middle)
    page.mouse.down()
    for part in (0.2, 0.15):
        page.mouse.move(place["x"] + part * place["width"], middle[1], steps=4)
        browsed.verdict("hunts", "bistable")
    assert not page.evaluate("window.grey")  # the map is of every machine on it
    page.mouse.up()
    assert browsed.crossover() < 5
    page.click("#undo")
    browsed.verdict("settles")
    page.focus(".handle")
    page.keyboard.press("ArrowRight")
    assert browsed.crossover() > 8
    page.click("#undo")
    page.wait_for_function(f"() => {rows} === 21 && !document.querySelector('#picture .figure').inert")
    across, up = place["x"] + 0.8 * place["width"], place["y"] + 0.5 * place["height"]
    page.mouse.move(across, up - 20)
    page.mouse.move(across, up)
    page.wait_for_selector("#beside .main-svg")
    page.mouse.click(across, up)
    page.wait_for_function("async () => 'friction.static' in (await import('/state.js')).changes()")
    assert browsed.crossover() > 15

    page.fill("#x-from", "3")
    page.keyboard.press("Tab")
    assert page.input_value("#x-from") == "3 Hz"
    with page.expect_request("**/ask/boundary"):
        page.click("#tab-boundary")
    page.wait_for_selector("#picture progress")
    browsed.type("8 kg")  # nothing says any more that it is computed
    page.wait_for_selector("#keys .wrong")
    page.wait_for_selector("progress", state="detached")


@pytest.mark.slow
def test_keyboard(unchecked: Browsed) -> None:
    """Everything is reached by keys, of which no single letter acts (WCAG 2.2, 2.1.4); the focus is never lost."""
    browsed = unchecked
    page, tabs = browsed.page, "#pictures-bar [role=tab]"
    page.focus("[data-part=lock]")
    page.keyboard.press("Space")
    browsed.says("Locked (as given): hunts")
    page.focus("#picture")
    page.keyboard.press("p")
    assert page.get_attribute("#pin", "aria-pressed") == "false"
    page.keyboard.press("Alt+p")
    assert page.get_attribute("#pin", "aria-pressed") == "true"
    page.keyboard.press("Control+z")
    assert browsed.changes() == {}
    names = page.eval_on_selector_all(tabs, "all => all.map(tab => tab.id)")
    page.focus(f"#{names[0]}")
    reached = []
    for key in ("ArrowLeft", "ArrowRight", "End", "Home", "ArrowRight"):
        page.keyboard.press(key)
        reached.append(browsed.focused())
    assert reached == [names[-1], names[0], names[-1], names[0], names[1]]
    page.keyboard.press("Enter")
    page.wait_for_selector(f"#{names[1]}[aria-selected=true]")
    assert browsed.focused() == names[1]
    assert page.eval_on_selector_all(f"{tabs}[tabindex='0']", "all => all.map(tab => tab.id)") == [names[1]]
    page.focus("#history button[tabindex='0']")
    page.keyboard.press("End")
    assert page.evaluate("document.activeElement === document.getElementById('history').lastChild")

    assert page.is_disabled("#close")
    for name in ("second.toml", "third.toml"):
        browsed.add(name)
    page.focus("#machine-1")
    page.keyboard.press("Delete")
    assert page.inner_text("#machines").split() == ["thesis_rig", "third"]
    page.focus("#close")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.textContent") == "thesis_rig"
    page.keyboard.press("Delete")
    assert page.locator("#machines [role=tab]").count() == 1  # the last one stays


@pytest.mark.slow
def test_narrow(browsed: Browsed) -> None:
    """What is there is drawn for the width, and nothing is asked; the verdict stays above the sliders."""
    page = browsed.page
    page.wait_for_selector("#answer .rest .note")
    page.click("#tab-map")
    page.select_option("#metric", "outcome")  # done in a moment
    page.wait_for_function("() => document.querySelector('.plot')?.data?.some((one) => one.z?.length === 21)")
    page.wait_for_function("row => document.querySelector(row).style.getPropertyValue('--track')", arg=SLIDER)
    page.wait_for_selector("#picture progress", state="detached")
    browsed.asked.clear()
    height = page.evaluate("document.querySelector('.plot').layout.height")
    page.set_viewport_size({"width": 400, "height": 900})
    page.wait_for_function("height => document.querySelector('.plot').layout.height > height", arg=height)
    assert [question for question in browsed.asked if question != "begin"] == []
    page.wait_for_selector("#small .main-svg")
    page.evaluate("document.querySelector('#keys').scrollIntoView()")
    glance, slider = (page.locator(name).bounding_box() for name in ("#glance", SLIDER))
    assert glance["y"] >= 0
    assert glance["height"] < 300
    assert slider["x"] + slider["width"] <= 400


@pytest.mark.slow
def test_offline(browsed: Browsed, chromium: Any) -> None:
    """Nothing is lost while no server answers; one that fails can be asked again, and one restarted is found."""
    page = browsed.page
    page.context.set_offline(True)
    browsed.type("11 Hz")
    page.wait_for_selector("#trouble:not([hidden])")
    page.context.set_offline(False)
    page.wait_for_selector("#trouble", state="hidden")
    browsed.says(friso.simulate(RIG, set={"controller.crossover": "11 Hz"}).sentences()[0], "picture")
    assert all("ERR_INTERNET_DISCONNECTED" in text for text in browsed.wrong)
    browsed.wrong.clear()
    held = browsed.hold("machine")
    browsed.add("other.toml", f"{TEXT}\n")
    held.come().fulfill(body=frame({"kind": "failed", "key": "", "text": "out of memory"}))
    browsed.says("out of memory")
    held.end()
    page.click("text=Ask again")
    browsed.field("8 Hz")

    with new_page(chromium) as page:
        with serving() as (token, address):
            page.goto(token)
            page.wait_for_selector("[data-part=controller]")
        page.wait_for_selector("#trouble:not([hidden])")
        with serving(address.rstrip("/").rpartition(":")[2]):
            page.wait_for_selector("#trouble", state="hidden")
            page.wait_for_selector("#verdict strong")


LINK = """changes => {
    const [machine] = JSON.parse(localStorage.getItem(`friso-machines-${sessionStorage.friso}`)).machines;
    const bytes = new TextEncoder().encode(JSON.stringify({ name: "linked.toml", text: machine.text, changes }));
    const packed = new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate-raw"));
    return new Response(packed).arrayBuffer().then((all) => {
        location.hash = btoa(Array.from(new Uint8Array(all), (byte) => String.fromCharCode(byte)).join(""))
            .replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
    });
}"""
"""The page goes to a link that holds a machine with these changes."""


@pytest.mark.slow
def test_hostile(browsed: Browsed, chromium: Any, tmp_path: Path) -> None:
    """No text of a file steers the page, broken links do no harm, and who has no key is let in by the address alone."""
    page = browsed.page
    every = "".join(map(chr, [*range(0xD800), *range(0xE000, 0x10000), *range(0xE0000, 0xE0080), 0x1F600]))
    assert page.evaluate("async (text) => (await import('/dom.js')).plain(text)", every) == escaped(every)
    page.click("#tab-logs")
    channels = ["time [s]", "\u202eposition\x1b[31m [m]", "force [N]"]
    page.set_input_files("#log-files", written(tmp_path, "steering.csv", channels))
    browsed.says("u202eposition", "picture")
    shown = page.inner_text("body")
    assert escaped(shown) == shown

    page.evaluate(LINK, {"masses.cart": [[1]]})
    page.wait_for_selector("#trouble:not([hidden])")
    page.evaluate(LINK, None)
    page.wait_for_selector("#machines >> text=linked")
    page.wait_for_selector("#trouble", state="hidden")
    page.reload()
    page.wait_for_selector("#machines >> text=linked")
    link = page.evaluate("async () => (await import('/state.js')).link()")
    mail = page.context.new_page()
    mail.route(
        "http://mail.example/*", lambda route: route.fulfill(body=f"<a href='{link}'>it</a>", content_type="text/html")
    )
    mail.goto("http://mail.example/")
    mail.click("text=it")
    mail.wait_for_selector("[data-part=controller]")  # a link of another site opens in a tab that the server lets in
    assert mail.url == browsed.address

    with new_page(chromium) as page:
        page.goto(browsed.address)
        page.wait_for_selector("#trouble:has-text('open that address')")
        assert page.locator("[data-part]").count() == 0
        opened = page.context.new_page()
        opened.goto(browsed.token)
        for one in (opened, page):
            one.wait_for_selector("[data-part=controller]")
        page.wait_for_selector("#trouble", state="hidden")
        assert opened.url == browsed.address  # without the token
        assert page.context.cookies() == []


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
def test_two_tabs(browsed: Browsed) -> None:
    """Each keeps its own, though a copied tab begins with the mark of the first; a full storage is said so."""
    page = browsed.page
    browsed.change({"masses.cart": "1.3 kg"})
    with page.context.expect_page() as opening:
        page.evaluate("window.open(location.href)")
    other = opening.value
    other.wait_for_selector("[data-part=controller]")
    page.wait_for_function("mark => sessionStorage.friso !== mark", arg=other.evaluate("sessionStorage.friso"))
    for one, crossover in ((other, "9 Hz"), (page, "11 Hz")):
        one.evaluate(CHANGE, {"controller.crossover": crossover})
    for one, crossover in ((other, "9 Hz"), (page, "11 Hz")):
        one.reload()
        one.wait_for_selector("[data-part=controller]")
        assert one.evaluate(CHANGES) == {"masses.cart": "1.3 kg", "controller.crossover": crossover}
    other.close()

    page.evaluate("""() => {
        const other = (name) => name.startsWith('friso-machines-') && !name.endsWith(sessionStorage.friso);
        Object.keys(localStorage).filter(other).forEach((name) => localStorage.removeItem(name));
        localStorage.setItem('friso-machines-old', 'x'.repeat(1000));
    }""")
    page.evaluate(FILL)
    browsed.change({"controller.crossover": "12 Hz"})
    assert page.evaluate(f"{KEPT}.step") == 3
    assert page.evaluate("localStorage.getItem('friso-machines-old')") is None  # what is of other tabs goes first
    assert page.is_hidden("#trouble")
    page.evaluate(FILL)
    page.evaluate("""() => {
        localStorage.setItem('other', localStorage.getItem('other').slice(40));
        localStorage.setItem('friso-machines-old', '{"at": 1}');
    }""")
    numbers = {"controller.crossover": "13 Hz", "masses.cart": "1.4 kg", "masses.stage": "0.61 kg"}
    browsed.change(numbers | {"joint.locked": True})
    page.wait_for_selector("#trouble:has-text('storage of the browser is full')")
    assert page.evaluate("localStorage.getItem('friso-machines-old')") == '{"at": 1}'  # nothing went in vain
    assert page.evaluate(f"{KEPT}.step") == 3
    page.evaluate("localStorage.removeItem('other')")
    browsed.change({"controller.crossover": "14 Hz"})
    page.wait_for_selector("#trouble", state="hidden")
    assert page.evaluate(f"{KEPT}.step") == 5


def long_report() -> str:
    """A page with tables and texts that scroll, as every command writes them."""
    lines = tuple(Series(np.arange(2.0), np.arange(2.0), f"a line with a long name, {k}", INK) for k in range(4))
    figure = Figure("f", "Lines", "", (Panel("A title", Axis("x", ""), Axis("y", ""), lines),))
    block = AnswerBlock(columns=["Locked"], rows=[("Verdict", ["hunts, " * 30])], draw=lambda: [figure])
    return Report("check", "Rig", [block], stage_file="name = 'a'\n" + "# " * 200).html()


@pytest.mark.slow
def test_axe(browsed: Browsed, tmp_path: Path) -> None:
    """No violation on the page or on one that a command writes, whose figures are drawn for its width."""
    page = browsed.page
    there = {"run": ".plot .main-svg", "map": ".plot .heatmaplayer image", "remedies": "#tune", "logs": ".drop"}
    browsed.add("second.toml")
    browsed.field("8 Hz")
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        for tab, content in there.items():
            browsed.show(tab, f"#picture {content}")
            assert violations(page) == []

    pages = {"check": (check_html(both_joints()), 7), "map": (page_of(plain()), 1), "report": (long_report(), 1)}
    page.emulate_media(color_scheme="light")
    for name, (html, figures) in pages.items():
        (tmp_path / f"{name}.html").write_text(html, encoding="utf-8")
        page.set_viewport_size({"width": 1600, "height": 20_000})  # figures are drawn as one scrolls to them
        page.goto((tmp_path / f"{name}.html").as_uri())
        page.wait_for_function("n => document.querySelectorAll('.js-plotly-plot').length == n", arg=figures)
        if name == "map":
            place = page.locator(".nsewdrag").bounding_box()
            page.mouse.move(place["x"] + 0.3 * place["width"], place["y"] + 0.3 * place["height"])  # of 4 by 5 cells
            told = page.wait_for_selector(".hoverlayer text").text_content().replace(" ", "")
            assert told.endswith("frisosimulate--cellmap.zarr13")
    height = page.evaluate("document.querySelector('.main-svg').clientHeight")
    page.set_viewport_size({"width": 400, "height": 900})
    page.wait_for_function("was => document.querySelector('.main-svg').clientHeight > was", arg=height)
    assert violations(page) == []
    assert all(url.startswith("file:") for url in browsed.outside)
    browsed.outside.clear()
