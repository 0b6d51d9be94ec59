"""The report in a real browser: it draws what the run holds, plays, tells values, and no text of
the user is run."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from heat_run import GRAINS, write_heated_run
from report_run import EVIL
from shaped_run import ANGLE, DISC, DUMBBELL, FRAME, PLACES, UPPER, write_shaped_run

from multicor_cli.report import write_report
from multicor_cli.store import open_run

sync_api = pytest.importorskip("playwright.sync_api", reason="needs the Python package playwright")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [pytest.mark.browser, pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")]

FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]  # fmt: skip


@pytest.fixture(scope="module")
def browser():
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def address(evil, tmp_path_factory):
    page = tmp_path_factory.mktemp("report") / "page.html"
    write_report(evil, page)
    return page.as_uri()


@pytest.fixture
def run(evil):
    """The run that the page is about."""
    with open_run(evil) as opened:
        yield opened


PLACE = """(grain) => { const p = state.picture, f = state.frame;
    const box = p.canvas.getBoundingClientRect(), half = p.canvas.width / 2;
    return [box.left + (half + (f.x[grain] - p.center[0]) * p.scale) / p.pixels,
            box.top + (p.middle - (f.y[grain] - p.center[1]) * p.scale) / p.pixels]; }"""
COLOR = """([x, y]) => { const p = state.picture;
    const at = [p.canvas.width / 2 + (x - p.center[0]) * p.scale,
                p.middle - (y - p.center[1]) * p.scale];
    const pixel = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
    pixel.drawImage(p.canvas, -Math.round(at[0]), -Math.round(at[1]));
    return [...pixel.getImageData(0, 0, 1, 1).data]; }"""

WATCH = r"""() => { const where = document.querySelector("#where");
    window.shown = [];
    new MutationObserver(() => window.shown.push(Number(/^frame (\d+) of/.exec(where.textContent)[1])))
        .observe(where, { childList: true }); }"""


class Opened:
    """A page, and everything that it said or asked for."""

    def __init__(self, browser, address, script="", **options):
        self.said, self.address = [], address
        usual = {"viewport": {"width": 1000, "height": 900}}
        self.context = browser.new_context(**usual | options)
        self.page = self.context.new_page()
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", self._requested)
        if script:
            self.page.add_init_script(script)
        self.page.goto(address)
        self.page.wait_for_selector("#where:not(:empty), #trouble:not([hidden])")
        self.settle()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.context.close()

    def _requested(self, request):
        if request.url != self.address:
            self.said.append(request.url)

    def settle(self):
        """Wait until what was asked for is drawn."""
        self.page.evaluate(
            "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
        )

    @property
    def frame(self):
        """Number of the frame that the page says it shows."""
        return int(re.match(r"frame (\d+) of", self.page.inner_text("#where")).group(1))

    def wait(self, is_so):
        """Wait until something is so; the policy of the page forbids to wait inside of it."""
        for _ in range(200):
            if is_so():
                return True
            self.page.wait_for_timeout(25)
        return False

    def place(self, grain):
        """Where a grain is in the window."""
        return tuple(self.page.evaluate(PLACE, grain))

    def color(self, x, y):
        """Color of a point in meters."""
        return self.page.evaluate(COLOR, [x, y])

    def picture(self):
        """Everything that is drawn."""
        self.settle()
        return self.page.evaluate("() => state.picture.canvas.toDataURL()")

    def key(self, name):
        """Press a key with the picture in focus."""
        self.page.press("#canvas", name)
        self.settle()


@pytest.fixture
def opened(browser, address):
    with Opened(browser, address) as opened:
        yield opened
        assert opened.said == []


def test_page_shows_the_last_frame_and_runs_no_text_of_the_user(opened):
    assert opened.frame == 5
    assert opened.page.inner_text("h1") == EVIL
    assert opened.page.evaluate("() => window.broken") is None
    assert opened.page.inner_text("#stage-name") == EVIL
    figures = opened.page.locator("figure").count()
    assert opened.page.locator("figure svg[role=img][aria-label]").count() == figures >= 4
    assert not opened.page.is_visible("#trouble")
    opened.page.click("details:has(pre) summary >> nth=0")
    assert EVIL in opened.page.inner_text("pre >> nth=0")


def test_it_plays_to_the_end_and_stops(opened):
    opened.page.select_option("#speed", "5")
    opened.page.evaluate(WATCH)
    play = "() => { const play = document.querySelector('#play'); play.click(); return play.textContent; }"
    assert "Pause" in opened.page.evaluate(play)
    assert opened.wait(lambda: "Play" in opened.page.inner_text("#play"))
    assert opened.page.evaluate("() => window.shown") == [0, 1, 2, 3, 4, 5]
    assert (opened.frame, opened.page.inner_text("#play")) == (5, "▶ Play")


def test_it_repeats_and_pauses(opened):
    opened.page.select_option("#speed", "10")
    opened.page.check("#loop")
    opened.page.click("#play")
    for frame in (5, 1, 4, 1):
        assert opened.wait(lambda frame=frame: opened.frame == frame)
    opened.page.click("#play")
    opened.page.wait_for_timeout(100)  # a frame may be on its way
    before = opened.frame
    opened.page.wait_for_timeout(200)
    assert opened.frame == before


def test_keyboard_and_scrubbing(opened):
    right = "ArrowRight"
    for key, frame in (
        ("Home", 0), (right, 1), (right, 2), ("ArrowLeft", 1), ("End", 5), (right, 5),
    ):  # fmt: skip
        opened.key(key)
        assert opened.wait(lambda frame=frame: opened.frame == frame)
    opened.key(" ")
    assert "Pause" in opened.page.inner_text("#play")
    opened.key(" ")
    opened.page.locator("#scrub").fill("3")
    assert opened.wait(lambda: opened.frame == 3)
    assert "t = 1.5 s · step 3" in opened.page.inner_text("#where")
    before = opened.page.evaluate("() => state.picture.zoom")
    opened.key("+")
    assert opened.page.evaluate("() => state.picture.zoom") > before
    opened.key("Shift+ArrowLeft")
    opened.key("0")
    assert opened.page.evaluate("() => state.picture.zoom") == 1
    opened.key("c")
    assert opened.page.is_checked("#contacts")


def test_pointing_tells_the_values_of_a_grain_and_a_click_keeps_them(opened):
    opened.page.mouse.move(*opened.place(3))
    tip = opened.page.inner_text("#tip").split("\n")
    told = dict(zip(tip[::2], tip[1::2], strict=True))
    assert told.items() >= {
        "grain": "3", "group": "other", "radius": "0.05 m", "speed": "0.3 m/s", "spin": "−2 rad/s",
        "temperature": "300.02 K", "generated heat": "0.003 W", "largest contact force": "4 N",
    }.items()  # fmt: skip
    opened.page.mouse.click(*opened.place(4))
    assert opened.page.input_value("#grain") == "4"
    opened.page.mouse.move(2, 2)
    assert not opened.page.is_visible("#tip")
    assert "0.4 m/s" in opened.page.inner_text("#chosen")
    opened.key("Home")
    assert opened.wait(lambda: "\n0 m/s" in opened.page.inner_text("#chosen"))
    opened.page.fill("#grain", "7")
    assert opened.page.inner_text("#chosen").split("\n")[1] == "7"
    opened.page.fill("#grain", str(GRAINS))
    assert not opened.page.is_visible("#chosen")


def test_values_under_a_resting_pointer_follow_the_frames(opened):
    """Frames 0 to 5: speeds are 0 in the first one; the grains of the column stay where they are in
    y."""
    opened.page.mouse.move(*opened.place(3))
    assert "0.3 m/s" in opened.page.inner_text("#tip")
    opened.key("ArrowLeft")
    assert opened.wait(lambda: opened.frame == 4)
    assert not opened.page.is_visible("#tip")  # the column has moved away
    opened.key("ArrowRight")
    assert opened.wait(lambda: opened.page.is_visible("#tip"))


def test_values_told_are_those_of_the_run_as_far_as_their_digits_go(opened, run):
    """The page stores steps of 1/65534 of the range; what it tells has no digits beyond that, and
    the others are right."""
    frame = run.frames[-1]
    own = np.maximum(contact_force := 1.0 + np.arange(GRAINS), np.append(0.0, contact_force[:-1]))
    expected = {
        "speed": np.hypot(*frame.velocity.T), "spin": frame.spin, "temperature": frame.temperature,
        "generated heat": 1e-3 * np.arange(GRAINS), "largest contact force": own,
    }  # fmt: skip
    for grain in range(GRAINS):
        told = dict(opened.page.evaluate("(grain) => valuesOf(grain)", grain))
        for name, values in expected.items():
            number, last = parse(told[name].split(" ")[0].replace("−", "-"))
            error = 0.5 * last + 2.0 / 65534 * np.abs(values).max()
            assert number == pytest.approx(values[grain], abs=error), (name, grain)
        x, y = told["x, y"].removesuffix(" m").split(", ")
        assert (float(x), float(y)) == pytest.approx(tuple(frame.position[grain]), abs=2e-4)


def test_grains_without_heat_have_the_color_of_the_paper(opened):
    found = opened.page.evaluate(
        """() => {
            const heat = meta.fields.find((field) => field.name === "heat");
            return [0, -1, ...heat.range].map((value) => colorIndex(heat, value, heat.range));
        }"""
    )
    assert found == [256, 256, 0, 255]
    opened.page.evaluate(
        "() => { state.field = meta.fields.find((field) => field.name === 'heat'); draw(); }"
    )
    assert "grains without color: none" in opened.page.inner_text("#bar-label")


def test_the_view_fits_the_frame_then_the_run_and_stays_where_it_was_put(opened):
    def box():
        left, right, bottom, top = opened.page.evaluate("() => state.picture.visible()")
        return right - left, top - bottom

    whole = opened.page.evaluate("() => meta.box")
    opened.key("ArrowLeft")
    assert opened.wait(lambda: opened.frame == 4)
    assert box()[0] >= whole[1][0] - whole[0][0] or box()[1] >= whole[1][1] - whole[0][1]
    opened.page.evaluate("() => zoomCenter(2)")
    near = box()
    opened.key("ArrowRight")
    assert opened.wait(lambda: opened.frame == 5)
    assert box() == near


SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def parse(text):
    """A number that the page tells, and what its last digit stands for."""
    mantissa, _, power = text.partition("·10")
    scale = 10.0 ** int(power.translate(SUPERSCRIPTS) or 0)
    return float(mantissa) * scale, 10.0 ** -len(mantissa.partition(".")[2]) * scale


def test_numbers_and_ticks_for_people(opened):
    for asked, expected in {
        "chooseTicks([0, 0.296]).map((t) => t[1])": "0 0.05 0.1 0.15 0.2 0.25",
        "chooseTicks([-3, 3]).map((t) => t[1])": "−3 −2 −1 0 1 2 3",
        "chooseTicks([1000, 1010]).map((t) => t[1])": "1000 1002 1004 1006 1008 1010",
        "chooseTicks([2e-7, 9e-7]).map((t) => t[1]).slice(0, 1)": "2·10⁻⁷",
        "chooseTicks([293, 373]).map((t) => t[1])": "300 320 340 360",
        "chooseTicks([1e-6, 1e-2], true).map((t) => t[1])": "1·10⁻⁶ 1·10⁻⁵ 1·10⁻⁴ 0.001 0.01",
        "[0, -0.5, 12345.678, 1e-5].map((number) => format(number))": "0 −0.5 1.235·10⁴ 1·10⁻⁵",
        "[-2.5e21, NaN].map((number) => format(number))": "−2.5·10²¹ –",
        "[1e-9, 1.23456789].map((x) => formatKnown('x', x, 6))": "0 1.2346",
    }.items():
        assert opened.page.evaluate(f"() => {asked}") == expected.split(), asked


def test_values_without_a_color_of_their_own_are_told(opened):
    opened.page.evaluate("() => { state.field = { ...state.field, range: [0, 0.45] }; draw(); }")
    label = "speed [m/s]; values up to 0.9 share the last color"
    assert opened.page.inner_text("#bar-label") == label


def test_the_first_color_shown_is_that_of_a_quantity_that_differs(browser, tmp_path):
    """Grains at rest with different temperatures, after a run of one frame: nothing to play."""
    write_heated_run(tmp_path / "run", frames=1)
    write_report(tmp_path / "run", tmp_path / "one.html")
    write_heated_run(tmp_path / "still", frames=2)
    write_report(tmp_path / "still", tmp_path / "still.html")
    with Opened(browser, (tmp_path / "one.html").as_uri()) as opened:
        for control in ("#play", "#back", "#next", "#scrub"):
            assert opened.page.is_disabled(control)
        assert "The only frame of the run." in opened.page.inner_text(".view")
        assert opened.said == []
    with Opened(browser, (tmp_path / "still.html").as_uri()) as opened:
        opened.key("Home")
        assert opened.wait(lambda: opened.frame == 0)
        # Nothing differs in this frame, speeds do in the run
        assert opened.page.evaluate("() => chooseField().name") == "speed"
        opened.page.evaluate("() => { state.frame.values.temperature[0] += 10; }")
        assert opened.page.evaluate("() => chooseField().name") == "temperature"


def test_a_script_that_got_into_the_page_does_not_run(browser, address, tmp_path):
    """The policy names the digest of the one program; this is what an escape that was forgotten
    would look like."""
    text = Path(address.removeprefix("file://")).read_text(encoding="utf-8")
    added = "<script>window.broken = 1</script><img src=x onerror='window.broken = 2'>"
    (tmp_path / "page.html").write_text(
        text.replace("<footer>", f"{added}<footer>"), encoding="utf-8"
    )
    with Opened(browser, (tmp_path / "page.html").as_uri()) as opened:
        assert opened.page.evaluate("() => window.broken") is None
        assert any("Content Security Policy" in words for words in opened.said)
        assert opened.frame == 5


def test_printed_pages_are_light_and_without_controls(opened):
    opened.page.click("#theme")
    opened.page.evaluate("() => window.dispatchEvent(new Event('beforeprint'))")
    opened.page.emulate_media(media="print")
    assert opened.page.evaluate("() => document.documentElement.dataset.theme") == "light"
    assert not opened.page.is_visible("#play")
    assert opened.page.is_visible("#canvas")
    opened.page.evaluate("() => window.dispatchEvent(new Event('afterprint'))")
    assert opened.page.evaluate("() => document.documentElement.dataset.theme") == "dark"


def test_grains_have_the_colors_of_their_values_also_across_the_period(opened):
    opened.key("ArrowLeft")  # frame 4: the column stands at x = 3.99 in a period of 4, radius 0.05
    assert opened.wait(lambda: opened.frame == 4)
    opened.page.select_option("#field", label="spin")
    opened.settle()
    expected = opened.page.evaluate(
        """() => { const field = state.field, value = state.frame.values.spin[8];
        const color = makeColors(field.colors)[colorIndex(field, value, field.range)];
        return color.match(/\\d+/g).map(Number); }"""
    )
    assert opened.color(3.985, 0.85) == [*expected, 255]
    assert opened.color(0.02, 0.85) == [*expected, 255]  # its image at the other end
    other = opened.color(3.985, 0.15)
    assert other[3] == 255
    assert other[:3] != expected
    assert opened.color(2.9, 0.85)[3] == 0


def test_choices_change_the_picture(opened):
    pictures = [opened.picture()]
    for label in ("spin", "temperature", "generated heat", "largest contact force"):
        opened.page.select_option("#field", label=label)
        pictures.append(opened.picture())
        assert label in opened.page.inner_text("#bar-label")
    opened.page.select_option("#range", "frame")
    opened.page.check("#contacts")
    pictures.append(opened.picture())
    assert (
        opened.page.inner_text("#contact-note")
        == "10 contacts carry a force; the widest lines stand for 22 N and more"
    )
    opened.page.select_option("#field", label="temperature")
    opened.settle()
    assert opened.page.inner_text("#bar-label") == "temperature above 300 K [mK]"
    assert len(set(pictures)) == len(pictures)
    opened.key("Home")
    assert opened.wait(lambda: "not in the file" in opened.page.inner_text("#contact-note"))


def test_zooming_keeps_the_place_and_fit_shows_everything(opened):
    whole = opened.picture()
    x, y = opened.place(5)
    opened.page.mouse.move(x, y)
    opened.page.mouse.wheel(0, -600)
    assert opened.wait(lambda: opened.picture() != whole)
    assert opened.place(5) == pytest.approx((x, y), abs=2.0)  # the wheel tells whole pixels
    opened.page.mouse.down()
    opened.page.mouse.move(x + 60, y + 30, steps=4)
    opened.page.mouse.up()
    opened.settle()
    assert opened.place(5) == pytest.approx((x + 60, y + 30), abs=8.0)
    opened.page.click("#zoom-out")
    opened.page.click("#fit")
    opened.page.mouse.move(2, 2)
    assert opened.picture() == whole


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_light_and_dark(scheme, browser, address):
    with Opened(browser, address, color_scheme=scheme) as opened:

        def brightness():
            color = "() => getComputedStyle(document.body).backgroundColor"
            return sum(map(int, re.findall(r"\d+", opened.page.evaluate(color))[:3]))

        before, picture = brightness(), opened.picture()
        assert (before > 600) == (scheme == "light")
        opened.page.click("#theme")
        assert (brightness() > 600) == (scheme == "dark")
        assert opened.picture() != picture
        opened.page.click("#theme")
        assert brightness() == before
        assert opened.said == []


def test_phone(browser, address):
    screen = {"viewport": {"width": 375, "height": 700}, "device_scale_factor": 2}
    opened = Opened(browser, address, has_touch=True, **screen)
    page = opened.page
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 375
    assert page.locator("#canvas").bounding_box()["width"] <= 375
    for control in page.locator("button:visible, select:visible, #scrub").all():
        box = control.bounding_box()
        assert box["height"] >= 32
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 375
    page.locator("#scrub").scroll_into_view_if_needed()
    page.touchscreen.tap(*opened.place(6))
    assert opened.wait(lambda: "0.6 m/s" in page.inner_text("#chosen"))
    assert "0.6 m/s" in page.inner_text("#tip")  # a finger does not hover
    for x in (0.3, 0.49, 0.51, 0.9):  # wherever it is, nothing of it is cut off
        box = page.locator("#canvas").bounding_box()
        at = {"clientX": x * 375, "clientY": box["y"] + 40}
        page.evaluate("(at) => { state.picture.findGrain = () => 6; showTip(at); }", at)
        tip = page.locator("#tip").bounding_box()
        assert tip["x"] >= box["x"] - 1
        assert tip["x"] + tip["width"] <= box["x"] + box["width"] + 1
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 375
    assert opened.said == []
    opened.context.close()


def test_two_fingers_zoom_and_the_page_does_not(browser, address):
    screen = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 3}
    opened = Opened(browser, address, has_touch=True, is_mobile=True, **screen)
    box = opened.page.locator("#canvas").bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    touch = opened.context.new_cdp_session(opened.page)
    for kind, apart in (("Start", 20), ("Move", 40), ("Move", 60), ("End", 0)):
        sides = (-1, 1) if apart else ()
        points = [{"x": x + side * apart, "y": y, "id": side + 1} for side in sides]
        touch.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": points})
    assert opened.wait(lambda: opened.page.evaluate("() => state.picture.zoom") > 2.0)
    assert opened.page.evaluate("() => visualViewport.scale") == 1
    assert opened.page.evaluate("() => state.picture.pixels === devicePixelRatio")
    assert opened.said == []
    opened.context.close()


def test_browser_without_decompression_says_so(browser, address):
    with Opened(browser, address, script="delete window.DecompressionStream") as opened:
        assert "too old" in opened.page.inner_text("#trouble")
        assert opened.page.locator("table").count() >= 3


FOUND = """([x, y]) => { const p = state.picture, box = p.canvas.getBoundingClientRect();
    return p.findGrain(state.frame, box.left + (p.canvas.width / 2 + (x - p.center[0]) * p.scale) / p.pixels,
                       box.top + (p.middle - (y - p.center[1]) * p.scale) / p.pixels); }"""


def test_grains_of_any_shape_are_drawn_and_found_as_they_are(browser, shaped, tmp_path):
    write_report(shaped, tmp_path / "page.html")
    with Opened(browser, (tmp_path / "page.html").as_uri()) as opened:
        opened.key("Home")
        assert opened.wait(lambda: opened.frame == 0)
        opened.settle()
        hole, notch = PLACES[FRAME], PLACES[ANGLE] + 0.05
        for x, y, grain in (
            (*hole, -1), (*notch, -1), (hole[0] + 0.1, hole[1], FRAME),
            (PLACES[ANGLE][0] - 0.06, PLACES[ANGLE][1] + 0.15, ANGLE), (0.03, 0.6, DUMBBELL),
            (1.0, 0.17, UPPER), (0.33, 0.15, DISC),
        ):  # fmt: skip
            assert opened.page.evaluate(FOUND, [x, y]) == grain
            assert (opened.color(x, y)[3] == 255) == (grain >= 0)
        opened.page.fill("#grain", str(ANGLE))
        told = opened.page.inner_text("#chosen").split("\n")
        assert dict(zip(told[::2], told[1::2], strict=True)).items() >= {
            "reach from the center": "0.2195 m", "angle": "0 rad",
        }.items()  # fmt: skip
        before = opened.picture()
        opened.key("End")
        assert opened.wait(lambda: opened.frame == 2)
        opened.page.check("#contacts")
        assert opened.picture() != before
        assert opened.said == []


def test_grains_that_grow_are_drawn_and_told_as_they_are(browser, tmp_path):
    """The square has 0.16 m at the start and half as much again at the end."""
    write_shaped_run(tmp_path / "run", growth=0.25)
    write_report(tmp_path / "run", tmp_path / "page.html")
    beside = PLACES[UPPER] + [0.1, 0.06]
    with Opened(browser, (tmp_path / "page.html").as_uri()) as opened:
        opened.page.fill("#grain", str(UPPER))
        for key, frame, grain, reach in (
            ("Home", 0, -1, "0.1131 m"),
            ("End", 2, UPPER, "0.1697 m"),
        ):
            opened.key(key)
            assert opened.wait(lambda number=frame: opened.frame == number)
            opened.settle()
            assert opened.page.evaluate(FOUND, list(beside)) == grain
            assert (opened.color(*beside)[3] == 255) == (grain >= 0)
            assert reach in opened.page.inner_text("#chosen")
        assert opened.said == []
