"""In a real browser: what the live view and an exported page draw, and how they act.

Chromium without a window. Where there is none these tests are skipped, but not in CI.
"""

import io
import itertools
import re
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import browsers
import numpy as np
import pinocchio as pin
import pytest
from browsers import HARMLESS
from PIL import Image, ImageSequence
from places import ROOT, THOROUGH

from hsp_control import Robot, Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.common.resources import bundled_configs
from hsp_control.companions.film import FilmStyle, export_film
from hsp_control.companions.film.encoding import find_ffmpeg
from hsp_control.visualization.viewer import LiveView, Viewer, export_html
from hsp_control.visualization.viewer.commands import PLOTS, set_property
from hsp_control.visualization.viewer.latest_commands import key_of
from hsp_control.visualization.viewer.offline.clip_reduction import (
    ANGLE_BOUND,
    POSITION_BOUND,
)

pytestmark = [pytest.mark.browser, pytest.mark.slow]

sync_api = pytest.importorskip("playwright.sync_api")

SIZE = (1000, 640)
# As configured, a run takes minutes without compiled kernels.
COARSE = (
    "simulation.control_period=null",
    "simulation.integrator={type: rk4, step: 0.01}",
    "simulation.log_period=0.02",
)
PLANAR = "paper/4_moving_obstacle"

EDGES = """() => {
  const {left, right} = PlotAxes.MARGIN;
  return [left, document.querySelector('#side svg').clientWidth - right];
}"""  # of the plots, from left to right
# What a page shows once it has drawn: without the two frames, a picture may be stale.
SETTLE = """() => { viewer.render(); return new Promise((drawn) =>
  requestAnimationFrame(() => requestAnimationFrame(drawn))); }"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    yield from browsers.started()


@pytest.fixture(scope="module")
def planar() -> Rollout:
    return load_experiment(PLANAR, "simulation.duration=4").run()


@pytest.fixture(scope="module")
def planar_page(planar: Rollout, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_html(planar, tmp_path_factory.mktemp("page") / "planar.html")


class Watched:
    """A page, and all that went wrong on it."""

    def __init__(self, browser: Any, address: str, size: tuple[int, int]) -> None:
        self.page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        self.wrong: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", self._on_console)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(address)

    def _on_console(self, message: Any) -> None:
        if message.type in {"error", "warning"} and HARMLESS not in message.text:
            self.wrong.append(message.text)

    def until(self, expression: str) -> None:
        browsers.until(self.page, expression)

    def picture(self, selector: str = "#meshcat-pane") -> np.ndarray:
        """What is seen of an element now, shape (height, width, 3)."""
        self.page.evaluate(SETTLE)
        data = self.page.locator(selector).screenshot()
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)

    def matrix(self, path: str) -> np.ndarray:
        """Where a node of the scene is in Pinocchio's world."""
        elements = self.page.evaluate(
            """(path) => {
              const root = node("").matrixWorld.clone().invert();
              const here = node(path);
              here.updateWorldMatrix(true, false);
              return root.multiply(here.matrixWorld).toArray();
            }""",
            path,
        )
        return np.reshape(elements, (4, 4)).T


@pytest.fixture
def watch(browser: Any) -> Iterator[Callable[..., Watched]]:
    opened: list[Watched] = []

    def open_watched(
        address: str | Path, size: tuple[int, int] = SIZE, at: str = ""
    ) -> Watched:
        if isinstance(address, Path):
            address = address.resolve().as_uri() + at
        opened.append(Watched(browser, address, size))
        return opened[-1]

    yield open_watched
    for watched in opened:
        watched.page.close()
    for watched in opened:
        assert watched.wrong == []


def exported(watch: Callable[..., Watched], page: Path, **about: Any) -> Watched:
    watched = watch(page, **about)
    watched.page.wait_for_selector("body[data-ready]", state="attached")
    return watched


def seek(watched: Watched, moment: float) -> None:
    watched.page.evaluate("(t) => { player.pause(); player.seek(t); }", moment)


def cursors(watched: Watched) -> list[float]:
    """Where the cursors stand in the plots, as the times below them."""
    return watched.page.evaluate(
        """() => [...document.querySelectorAll("#side svg")].map((picture) => {
          const cursor = picture.querySelector(".cursor").transform.baseVal;
          return cursor.consolidate().matrix.e;
        })"""
    )


# -- an exported page -----------------------------------------------------------------


@pytest.mark.smoke
def test_the_arm_is_drawn_and_moves(
    planar: Rollout, planar_page: Path, watch: Callable[..., Watched]
) -> None:
    watched = exported(watch, planar_page, at="#t=0")
    first = watched.picture()
    seek(watched, 1.0)
    second = watched.picture()
    again = watched.picture()
    seek(watched, 0.0)
    back = watched.picture()
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 500  # light and shade
    dark = first.sum(axis=2) < 200  # the arm's joints
    assert 500 < dark.sum() < 0.1 * dark.size
    moved = np.abs(second - first).max(axis=2) > 40
    assert moved.sum() > 3000
    np.testing.assert_array_equal(second, again)
    np.testing.assert_array_equal(first, back)
    assert watched.requests == [planar_page.resolve().as_uri()]


def test_every_joint_is_where_pinocchio_has_it(
    tmp_path: Path, watch: Callable[..., Watched]
) -> None:
    rollout = load_experiment("panda_obstacle", *COARSE).run()
    page = export_html(rollout, tmp_path / "panda.html")
    assert page.stat().st_size < 2e6
    watched = exported(watch, page, at="#t=0")
    robot = Robot.load("panda")
    data = robot.model.createData()
    for row in (0, 37, 250, len(rollout) - 1):
        seek(watched, rollout.t[row])
        pin.forwardKinematics(robot.model, data, rollout.q[row])
        for joint, name in enumerate(robot.model.names[1:], start=1):
            shown = pin.SE3(watched.matrix(f"/robot/{name}"))
            off = data.oMi[joint].actInv(shown)
            assert np.linalg.norm(off.translation) <= POSITION_BOUND * 1.01
            turned = np.linalg.norm(pin.log3(off.rotation))
            assert turned <= ANGLE_BOUND * 1.01
    meshes = watched.page.evaluate(
        """() => {
          const seen = [];
          node("/robot").traverse(({geometry}) => {
            const {position, normal} = geometry?.attributes ?? {};
            const corners = geometry?.index?.count;
            if (position) seen.push([position.count, normal.count, corners]);
          });
          return seen;
        }"""
    )
    assert len(meshes) > 11
    assert all(vertices == normals for vertices, normals, _ in meshes)
    assert sum(corners for *_, corners in meshes) / 3 > 130_000  # all there are


def test_timeline_plots_and_robot_move_together(
    planar: Rollout, planar_page: Path, watch: Callable[..., Watched]
) -> None:
    watched = exported(watch, planar_page, at="#t=2")
    page = watched.page
    assert page.evaluate("[player.time, player.playing]") == [2.0, False]
    left, right = page.evaluate(EDGES)

    def expect(moment: float) -> None:
        at = left + moment / 4.0 * (right - left)
        np.testing.assert_allclose(cursors(watched), at, atol=0.02)
        assert page.locator(".player .clock").inner_text().startswith(f"{moment:.2f} /")
        assert float(page.locator(".timeline").input_value()) == pytest.approx(moment)

    assert len(cursors(watched)) == 7
    expect(2.0)
    seek(watched, 3.25)
    expect(3.25)
    shown = page.locator("#side section:nth-of-type(4) output").all_inner_texts()
    row = int(np.argmin(np.abs(planar.t - 3.25)))
    angles = np.cumsum(planar["joint_positions"][row])
    numbers = [float(text.replace("−", "-")) for text in shown]
    np.testing.assert_allclose(numbers, angles, atol=0.02)

    # A click in a plot goes there; the cursor can be taken, and follows.
    box = page.locator("#side svg").nth(1).bounding_box()
    quarter = left + 0.25 * (right - left)
    page.mouse.click(box["x"] + quarter, box["y"] + 40)
    assert page.evaluate("player.time") == pytest.approx(1.0, abs=0.02)
    page.mouse.down()
    page.mouse.move(box["x"] + left + 0.5 * (right - left), box["y"] + 45, steps=3)
    page.mouse.up()
    released = page.evaluate("player.time")
    assert released == pytest.approx(2.0, abs=0.02)
    page.mouse.move(box["x"] + left, box["y"] + 40)
    assert page.evaluate("player.time") == released

    # Playing moves all of it.
    page.keyboard.press("Space")
    watched.until("player.time > 2.2")
    page.keyboard.press("Space")
    expect(page.evaluate("player.time"))
    page.evaluate("location.hash = '#t=0.5'")
    watched.until("player.time === 0.5")
    expect(0.5)


def test_it_plays_by_itself_and_to_its_end(
    planar_page: Path, watch: Callable[..., Watched]
) -> None:
    watched = exported(watch, planar_page)
    assert watched.page.evaluate("player.playing")
    watched.page.evaluate("player.setSpeed(8)")
    watched.until("!player.playing")
    assert watched.page.evaluate("player.time === player.end")


def test_the_plots_can_be_put_away_and_narrow_screens_stack(
    planar_page: Path, watch: Callable[..., Watched]
) -> None:
    watched = exported(watch, planar_page, at="#t=1")
    page = watched.page
    width = page.locator("#meshcat-pane canvas").bounding_box()["width"]
    page.keyboard.press("g")
    watched.until(f"document.querySelector('canvas').clientWidth === {SIZE[0]}")
    assert width < SIZE[0]
    assert not page.locator("#side").is_visible()
    page.locator(".player .side").click()
    watched.until(f"document.querySelector('canvas').clientWidth === {width}")

    page.set_viewport_size({"width": 390, "height": 800})
    watched.until("document.querySelector('canvas').clientWidth === 390")
    stage, side = (page.locator(x).bounding_box() for x in ("#stage", "#side"))
    assert side["y"] == pytest.approx(stage["y"] + stage["height"], abs=1)
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    image = watched.picture()
    arm = np.argwhere(image.sum(axis=2) < 200)
    assert arm.size
    assert (arm.min(axis=0) > 2).all()  # all of it is in sight


def test_a_page_has_its_bands_and_presents(
    planar: Rollout, tmp_path: Path, watch: Callable[..., Watched]
) -> None:
    """On a dark background, on which nothing of it stays light."""
    damped = np.where((planar.t > 1.0) & (planar.t < 2.0), 1.0, 0.0)
    bounded = Rollout({**planar.columns, "damped": damped}, planar.meta)
    page_file = export_html(bounded, tmp_path / "dark.html", background="#14202B")
    watched = exported(watch, page_file, at="#t=1.5")
    page = watched.page
    band = page.locator(".bands button")
    assert band.get_attribute("aria-label") == "bounded at a singularity 1.01–2.00 s"
    assert (
        page.locator(".moments").inner_text() == "the law is bounded at a singularity"
    )
    for selector in (".player", "#side"):
        assert np.median(watched.picture(selector), axis=(0, 1)).max() < 60

    page.keyboard.press("p")
    watched.until(f"document.querySelector('canvas').clientWidth === {SIZE[0]}")
    assert page.locator("#side").is_hidden()
    assert page.locator("#layers").is_hidden()
    assert page.locator(".moments").is_visible()
    page.keyboard.press("Escape")
    watched.until(f"document.querySelector('canvas').clientWidth < {SIZE[0]}")
    assert page.locator("#side").is_visible()


# -- the legend, whose rows are switches ----------------------------------------------


PHONE = (390, 844)


def row(watched: Watched, name: str) -> Any:
    return watched.page.locator("#layers button").get_by_text(name, exact=True)


def states(watched: Watched) -> dict[str, bool]:
    """Which rows of the legend are switched on."""
    return watched.page.evaluate(
        """() => {
          const rows = [...document.querySelectorAll("#layers button")];
          const state = (row) => row.getAttribute("aria-pressed") === "true";
          return Object.fromEntries(rows.map((row) => [row.textContent, state(row)]));
        }"""
    )


def orange(watched: Watched) -> int:
    """How many pixels have the colour of obstacles."""
    image = watched.picture()
    red, green, blue = np.moveaxis(image, 2, 0)
    return int(((red > 190) & (green < 150) & (green > 70) & (blue < 90)).sum())


def test_a_row_of_the_legend_switches_what_it_names(
    planar_page: Path, watch: Callable[..., Watched]
) -> None:
    watched = exported(watch, planar_page, at="#t=1")
    page = watched.page
    assert states(watched) == {
        "desired path": True,
        "actual path": True,
        "target": True,
        "obstacle disk": True,
        "distance to the obstacle's centre": True,
        "manipulability": False,
        "self-motion in 0.2 s (pale: the field's)": True,
        "robot": True,
        "grid": True,
        "shadow": True,
    }
    assert page.locator(".dg").count() == 0  # Meshcat's own controls
    before = orange(watched)
    assert before > 500
    row(watched, "obstacle disk").click()
    assert not states(watched)["obstacle disk"]
    assert orange(watched) < 0.1 * before
    # The keyboard returns to the player after a click, and stays with a focused row.
    page.keyboard.press("Space")
    assert page.evaluate("player.playing")
    page.keyboard.press("Space")
    assert not page.evaluate("player.playing")
    for key in ("Enter", "Space"):
        row(watched, "manipulability").focus()
        was = states(watched)["manipulability"]
        page.keyboard.press(key)
        assert states(watched)["manipulability"] is not was
        assert page.evaluate("node('/ellipsoid/tip').visible") is not was
        assert not page.evaluate("player.playing")


def test_a_choice_survives_what_the_program_sends_later(
    planar: Rollout, watch: Callable[..., Watched]
) -> None:
    experiment = load_experiment(PLANAR, "simulation.duration=4")
    with Viewer(experiment.robot) as viewer:
        viewer.play(planar, controller=experiment.controller)
        watched = watch(viewer.url)
        assert viewer.wait_for_browser(200.0)
        row(watched, "obstacle disk").click()
        row(watched, "manipulability").click()
        chosen = states(watched)
        assert (chosen["obstacle disk"], chosen["manipulability"]) == (False, True)
        row(watched, "grid").focus()
        # All layers are deleted and drawn again, and the legend is sent again.
        viewer.replace_run(planar, 3.0, experiment.controller, "again")
        assert viewer.wait_for_browser(200.0)
        assert watched.page.locator("#caption .status").inner_text() == "again"
        assert states(watched) == chosen
        assert not watched.page.evaluate("node('/obstacles').visible")
        assert watched.page.evaluate("node('/ellipsoid/tip').visible")
        assert watched.page.evaluate("document.activeElement.textContent") == "grid"
        # What the program hides, the row tells.
        viewer.transport.send([set_property("/robot", "visible", False)])
        assert viewer.wait_for_browser(200.0)
        assert not states(watched)["robot"]
        watched.page.close()


def test_bars_have_their_length_beside_them(
    planar: Rollout, planar_page: Path, watch: Callable[..., Watched]
) -> None:
    watched = exported(watch, planar_page, at="#t=0")
    label = watched.page.locator(".length-label")
    places = []
    for moment in (0.0, 1.0, 2.5):
        seek(watched, moment)
        watched.page.evaluate(SETTLE)
        logged = planar["distance.point_distance"][np.argmin(abs(planar.t - moment))]
        assert float(label.inner_text().removesuffix(" m")) == pytest.approx(
            logged, abs=0.006
        )
        box, bar = label.bounding_box(), middle(watched)
        center = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
        assert 10 < np.linalg.norm(np.subtract(center, bar)) < 60
        places.append(center)
    assert len(np.unique(np.round(places), axis=0)) == 3  # it follows
    row(watched, "distance to the obstacle's centre").click()
    watched.page.evaluate(SETTLE)
    assert not label.is_visible()


def middle(watched: Watched) -> list[float]:
    """Where the middle of the only distance bar is on the screen."""
    return watched.page.evaluate(
        """() => {
          const [path] = lengthLabels.paths;
          const point = new MeshCat.THREE.Vector3(0, 0, 0.5);
          point.applyMatrix4(node(path).matrixWorld).project(viewer.camera);
          const {width, height, left, top} = viewer.dom_element.getBoundingClientRect();
          return [left + (point.x + 1) / 2 * width, top + (1 - point.y) / 2 * height];
        }"""
    )


def test_on_a_phone_the_legend_waits_behind_a_button_and_all_is_in_sight(
    planar: Rollout, watch: Callable[..., Watched]
) -> None:
    with Viewer(Robot.load("planar3r")) as viewer:
        viewer.draw_scene(planar)
        watched = watch(viewer.url, size=PHONE)
        page = watched.page
        assert viewer.wait_for_browser(200.0)
        page.evaluate(SETTLE)
        assert page.locator("meta[name=viewport]").count() == 1
        assert page.evaluate("document.documentElement.scrollWidth") == PHONE[0]
        assert not page.locator("#layers").is_visible()
        button = page.locator("#caption .layers-toggle")
        assert button.get_attribute("aria-expanded") == "false"
        left, right, top, bottom = spread(watched)
        heading = page.locator("#caption h1").bounding_box()
        bar = page.locator(".player").bounding_box()
        assert left > 0
        assert right < PHONE[0]
        assert top > heading["y"] + heading["height"]
        assert bottom < bar["y"]
        assert right - left > 0.5 * PHONE[0]  # and not small

        button.click()
        assert page.locator("#layers").is_visible()
        row(watched, "obstacle disk").click()
        assert not states(watched)["obstacle disk"]
        button.click()
        assert not page.locator("#layers").is_visible()

        # Turned to a large window, the rows are there, and the camera is nearer.
        far = page.evaluate("viewer.camera.position.length()")
        page.set_viewport_size({"width": 1280, "height": 800})
        page.evaluate(SETTLE)
        assert page.locator("#layers").is_visible()
        assert page.evaluate("viewer.camera.position.length()") < 0.8 * far
        # A camera that the user has moved stays where it is.
        page.mouse.move(900, 400)
        page.mouse.wheel(0, -240)
        page.evaluate(SETTLE)
        moved = page.evaluate("viewer.camera.position.toArray()")
        page.set_viewport_size({"width": PHONE[0], "height": PHONE[1]})
        page.evaluate(SETTLE)
        kept = page.evaluate("viewer.camera.position.toArray()")
        np.testing.assert_allclose(kept, moved, rtol=1e-6)
        page.close()


def spread(watched: Watched) -> list[float]:
    """The box on the screen around all joints and paths: left, right, top, bottom."""
    return watched.page.evaluate(
        """() => {
          const {width, height} = viewer.dom_element.getBoundingClientRect();
          const {Box3, Vector3} = MeshCat.THREE;
          const box = new Box3();
          for (const path of ["/robot", "/paths"]) {
            node(path).traverse((thing) => {
              const {position} = thing.geometry?.attributes ?? {};
              for (let k = 0; k < (position?.count ?? 0); k++) {
                const point = new Vector3().fromBufferAttribute(position, k);
                point.applyMatrix4(thing.matrixWorld).project(viewer.camera);
                box.expandByPoint(point);
              }
            });
          }
          return [(1 + box.min.x) / 2 * width, (1 + box.max.x) / 2 * width,
                  (1 - box.max.y) / 2 * height, (1 - box.min.y) / 2 * height];
        }"""
    )


@pytest.mark.parametrize("eye", [None, [2.6, -1.4, 1.3]])
def test_a_tall_and_wide_robot_fits_a_window_of_any_shape(
    eye: list[float] | None, watch: Callable[..., Watched]
) -> None:
    with Viewer(Robot.load("tiago"), camera=eye, background="#14202B") as viewer:
        watched = watch(viewer.url, size=PHONE)
        assert viewer.wait_for_browser(200.0)
        page = watched.page
        for width, height in (PHONE, (844, 390), (700, 700)):
            page.set_viewport_size({"width": width, "height": height})
            page.evaluate(SETTLE)
            left, right, top, bottom = spread(watched)
            assert left > 0
            assert right < width
            if eye is None:
                assert top > 0
                assert bottom < height
        color = "getComputedStyle(document.getElementById('caption')).color"
        assert page.evaluate(color) == "rgb(246, 247, 248)"  # the background is dark
        page.close()


# -- the live view --------------------------------------------------------------------


def test_the_live_view_has_the_run_s_plots(
    planar: Rollout, watch: Callable[..., Watched]
) -> None:
    """While it is computed and after; they keep what the user has made of them."""
    experiment = load_experiment(PLANAR, "simulation.duration=4")
    partial: list[Any] = []

    def on_row(recorder: Any) -> None:
        live.on_row(recorder)
        if not partial and recorder.rows(0)["t"][-1] >= 1.0:
            assert viewer.wait_for_browser(200.0)
            plot = watched.page.locator("#side svg").first
            partial.append(plot.get_attribute("aria-valuemax"))
            watched.page.locator("#side .plot button").first.click()

    with Viewer(experiment.robot) as viewer:
        watched = watch(viewer.url)
        page = watched.page
        live = LiveView(viewer, experiment)
        assert not page.locator("#side").count()  # there is no run yet
        log = experiment.run(on_row=on_row)
        assert partial == ["4"]  # the axis is that of the whole run
        live.finish(log)
        assert viewer.wait_for_browser(200.0)
        assert page.locator("#side .plot").count() == 7
        alone = page.locator("#side .plot button").first.get_attribute("aria-pressed")
        assert alone == "true"

        # One command for each picture of the plots: the newest replaces the last.
        kept = [
            name for path, name, _ in viewer.transport.scene.items() if path == PLOTS
        ]
        assert kept == ["plots"]
        left, right = page.evaluate(EDGES)
        for moment in (1.0, 3.25):
            seek(watched, moment)
            at = left + moment / 4.0 * (right - left)
            np.testing.assert_allclose(cursors(watched), at, atol=0.02)

        viewer.draw_scene(experiment.scene)  # no run, no plots
        assert viewer.wait_for_browser(200.0)
        assert not page.locator("#side").is_visible()
        assert viewer.transport.scene.get(key_of(PLOTS, "plots")) is None
        viewer.play(planar)
        assert viewer.wait_for_browser(200.0)
        assert page.locator("#side").is_visible()
        local = ("http://127.0.0.1", "ws://127.0.0.1", "data:")
        assert all(request.startswith(local) for request in watched.requests)


def test_on_a_phone_the_plots_of_the_live_view_are_away_at_first(
    planar: Rollout, watch: Callable[..., Watched]
) -> None:
    with Viewer(Robot.load("planar3r")) as viewer:
        viewer.play(planar)
        watched = watch(viewer.url, size=PHONE)
        assert viewer.wait_for_browser(200.0)
        assert not watched.page.locator("#side").is_visible()
        watched.page.locator(".player .side").click()
        assert watched.page.locator("#side").is_visible()
        assert watched.page.evaluate("document.documentElement.scrollWidth") == PHONE[0]


# -- films ----------------------------------------------------------------------------


def test_a_film_shows_its_moments_and_is_the_same_again(
    planar: Rollout, browser: Any, tmp_path: Path
) -> None:
    del browser  # there is one
    style = FilmStyle(size=(320, 240), frame_rate=5.0, speed=2.0, plots=False)
    done: list[float] = []
    first, again = (
        export_film(planar, tmp_path / name, style=style, progress=done.append)
        for name in ("a.gif", "b.gif")
    )
    assert first.read_bytes() == again.read_bytes()
    assert done == [k / 11 for k in range(1, 12)] * 2
    with Image.open(first) as film:
        frames = [np.asarray(f.convert("RGB")) for f in ImageSequence.Iterator(film)]
        assert film.size == (320, 240)
        assert film.info["duration"] == 200
        assert film.info["loop"] == 0
    assert len(frames) == 11
    for one, two in itertools.pairwise(frames):
        assert (np.abs(one.astype(int) - two).max(axis=2) > 40).sum() > 200
    assert {file.name for file in tmp_path.iterdir()} == {"a.gif", "b.gif"}


def test_films_from_the_command_line(
    planar: Rollout, browser: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    del browser
    log = planar.save(tmp_path / "run.npz")
    films = [tmp_path / "new" / f"film.{kind}" for kind in ("mp4", "webp")]
    wanted = [f"--{film.suffix[1:]}={film}" for film in films]
    style = ["--size=301x200", "--fps=4", "--speed=4"]
    assert main(["export", str(log), *wanted, *style]) == 0
    assert [line.partition(": ")[2] for line in capsys.readouterr().out.split("\n")][
        :-1
    ] == [str(film) for film in films]
    told = subprocess.run(
        [find_ffmpeg(), "-hide_banner", "-i", str(films[0]), "-f", "null", "-"],
        capture_output=True,
        text=True,
        check=True,
    ).stderr
    assert "Video: h264" in told
    assert "302x200" in told  # H.264 has even sizes only
    assert "Duration: 00:00:01.25" in told
    with Image.open(films[1]) as film:
        assert (film.format, film.size) == ("WEBP", (301, 200))
        assert film.n_frames == 5


def test_the_document_s_film(
    planar: Rollout, browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    del browser
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "export.md").read_text(encoding="utf-8")
    snippet = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)[-1]
    columns = {name: column[:101] for name, column in planar.columns.items()}
    exec(snippet, {"rollout": Rollout(columns, planar.meta)})
    with Image.open(tmp_path / "out" / "film.webp") as film:
        assert film.n_frames == 6


# -- every configuration --------------------------------------------------------------


# A robot's motion is run coarsely and not to its end: what it does is tested elsewhere.
# A plant that moves by itself needs its control period: there only the beginning is.
QUICK = (*COARSE, "simulation.duration=4")
SHORT = ("simulation.duration=0.6",)
SHOWN = {"paper": (), "whole_body": SHORT, "forces": SHORT, "compliance": SHORT}


EACH_KIND = ("panda_obstacle", "whole_body/talos_circle")


@pytest.mark.parametrize("name", bundled_configs() if THOROUGH else EACH_KIND)
def test_a_configuration_has_its_picture(
    name: str, browser: Any, tmp_path: Path
) -> None:
    overrides = SHOWN.get(name.partition("/")[0], QUICK)
    rollout = load_experiment(name, *overrides).run()
    file = export_html(rollout, tmp_path / "page.html")
    moment = 0.6 * rollout.t[-1]
    page, wrong = browsers.exported(browser, file, moment, (1280, 800))
    page.evaluate(SETTLE)
    picture = page.screenshot()
    page.close()
    assert wrong == []
    with Image.open(io.BytesIO(picture)) as image:
        pixels = np.asarray(image.convert("RGB"))
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 1000
