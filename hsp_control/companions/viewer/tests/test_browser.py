"""The live view and an exported page in a real browser: drawing and interaction.

Chromium without a window. Where there is none these tests are skipped, but not in CI.
"""

import io
import itertools
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
from places import further

from hsp_control import Robot, Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.companions.film import FilmStyle, export_film
from hsp_control.companions.film.encoding import find_ffmpeg
from hsp_control.companions.viewer import LiveView, Viewer, export_html
from hsp_control.companions.viewer.commands import PLOTS, key_of

pytest.importorskip("playwright.sync_api")


SIZE = (1000, 640)
# As configured, a run takes minutes without compiled kernels.
COARSE = (
    "simulation.control_period=null",
    "simulation.integrator={type: rk4, step: 0.01}",
    "simulation.log_period=0.02",
)
PLANAR = "paper/4_moving_obstacle"

WIDTH = "document.querySelector('#side .u-over').clientWidth"  # of the plots' curves
END = "uPlot.sync('run').plots[0].scales.x.max"  # of the axis of time
# The page's picture once it has drawn: without the two frames, it may be stale.
SETTLE = """() => { viewer.render(); return new Promise((drawn) =>
  requestAnimationFrame(() => requestAnimationFrame(drawn))); }"""


@pytest.fixture(scope="module")
def planar() -> Rollout:
    return load_experiment(PLANAR, "simulation.duration=4").run()


@pytest.fixture(scope="module")
def planar_page(planar: Rollout, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_html(planar, tmp_path_factory.mktemp("page") / "planar.html")


class Watched:
    """A page, and its errors."""

    def __init__(
        self, browser: Any, address: str, size: tuple[int, int], *, lightly: bool
    ) -> None:
        self.page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        self.wrong: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", self._on_console)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(browsers.light(address) if lightly else address)

    def _on_console(self, message: Any) -> None:
        if message.type in {"error", "warning"} and HARMLESS not in message.text:
            self.wrong.append(message.text)

    def until(self, expression: str) -> None:
        browsers.until(self.page, expression)

    def picture(self, selector: str = "#meshcat-pane") -> np.ndarray:
        """The current picture of an element, shape (height, width, 3)."""
        self.page.evaluate(SETTLE)
        data = self.page.locator(selector).screenshot()
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)

    def matrix(self, path: str) -> np.ndarray:
        """Pose of a scene's node in Pinocchio's world."""
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
        address: str | Path,
        size: tuple[int, int] = SIZE,
        at: str = "",
        *,
        lightly: bool = True,
    ) -> Watched:
        if isinstance(address, Path):
            address = address.resolve().as_uri() + at
        opened.append(Watched(browser, address, size, lightly=lightly))
        return opened[-1]

    yield open_watched
    for watched in opened:
        watched.page.close()
    for watched in opened:
        assert watched.wrong == []


def exported(
    watch: Callable[..., Watched], page: Path, *, fully: bool = False, **about: Any
) -> Watched:
    watched = watch(page, lightly=not fully, **about)
    watched.page.wait_for_selector("body[data-ready]", state="attached")
    return watched


def seek(watched: Watched, moment: float) -> None:
    watched.page.evaluate("(t) => { player.pause(); player.seek(t); }", moment)


def cursors(watched: Watched) -> list[float]:
    """Positions of the cursors in the plots, from the left of their curves."""
    return watched.page.evaluate(
        """() => [...document.querySelectorAll("#side .cursor")].map((cursor) =>
          new DOMMatrix(getComputedStyle(cursor).transform).e)"""
    )


# -- an exported page -----------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.smoke
def test_the_arm_is_drawn_and_moves(
    planar: Rollout, planar_page: Path, watch: Callable[..., Watched]
) -> None:
    watched = exported(watch, planar_page, fully=True, at="#t=0")
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


@pytest.mark.slow
@pytest.mark.browser
def test_every_joint_is_where_pinocchio_has_it(
    tmp_path: Path, watch: Callable[..., Watched]
) -> None:
    settings = *COARSE, "simulation.duration=1"
    rollout = load_experiment("panda_obstacle", *settings).run()
    page = export_html(rollout, tmp_path / "panda.html")
    assert page.stat().st_size < 2e6
    watched = exported(watch, page, at="#t=0")
    robot = Robot.load("panda")
    data = robot.model.createData()
    for row in (0, 17, 37, len(rollout) - 1):
        seek(watched, rollout.t[row])
        pin.forwardKinematics(robot.model, data, rollout.q[row])
        for joint, name in enumerate(robot.model.names[1:], start=1):
            shown = pin.SE3(watched.matrix(f"/robot/{name}"))
            off = data.oMi[joint].actInv(shown)
            assert np.linalg.norm(off.translation) <= 2e-4
            turned = np.linalg.norm(pin.log3(off.rotation))
            assert turned <= np.radians(0.1)
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
    fingers = watched.page.evaluate(
        """() => {
          const of = (path) => {
            const found = [];
            node(path).traverse(({geometry}) => geometry && found.push(geometry));
            return found;
          };
          const [one, other] = ['left', 'right'].map(
            (side) => of(`/robot/panda_joint7/panda_${side}finger`));
          return [one.length, one.every((geometry, k) => geometry === other[k])];
        }"""
    )
    assert fingers[0] > 0  # of one mesh: one geometry
    assert fingers[1]


@pytest.mark.slow
@pytest.mark.browser
def test_views_by_key_button_and_configuration(
    tmp_path: Path, watch: Callable[..., Watched]
) -> None:
    experiment = load_experiment(
        "ur5_position", *COARSE, "simulation.duration=1", "view.camera=tool"
    )
    rollout = experiment.run()
    page = export_html(rollout, tmp_path / "ur5.html")
    watched = exported(watch, page, at="#t=0")
    browser = watched.page
    seen = """() => {
      const root = node("").matrixWorld.clone().invert(), {controls, camera} = viewer;
      const here = (point) => point.clone().applyMatrix4(root).toArray();
      const [eye, target] = [camera.position, controls.target].map(here);
      return [views.name, eye, target];
    }"""

    def looked(name: str) -> tuple[np.ndarray, np.ndarray]:
        """The unit direction to the camera, and the point that it looks at."""
        browser.evaluate("viewer.render()")
        found, eye, target = browser.evaluate(seen)
        assert found == name
        pressed = browser.locator(".views [aria-pressed=true]").all_inner_texts()
        assert pressed == ([name] if name else [])
        away = np.subtract(eye, target)
        return away / np.linalg.norm(away), np.array(target)

    robot = experiment.robot
    tool = rollout.measure(robot, lambda state: state.position(robot.end_effector))
    np.testing.assert_allclose(looked("tool")[1], tool[0], atol=1e-4)
    seek(watched, 0.8)
    row = np.searchsorted(rollout.t, 0.8 - 1e-9)
    assert np.linalg.norm(tool[row] - tool[0]) > 0.01
    np.testing.assert_allclose(looked("tool")[1], tool[row], atol=1e-4)  # it follows
    browser.keyboard.press("c")
    whole = looked("")[1]
    for name, direction in (
        ("front", [0.993, 0.0, 0.119]), ("side", [0.0, -0.993, 0.119]),
        ("top", [0.0, 0.0, 1.0]),
    ):  # fmt: skip
        browser.keyboard.press("c")
        way, target = looked(name)
        np.testing.assert_allclose(way, direction, atol=1e-3)
        np.testing.assert_allclose(target, whole, atol=1e-6)
    browser.locator(".views button").get_by_text("side").click()
    looked("side")
    browser.set_viewport_size({"width": 500, "height": 700})
    browser.wait_for_timeout(200)
    np.testing.assert_allclose(looked("side")[0], [0.0, -0.993, 0.119], atol=1e-3)


@pytest.mark.slow
@pytest.mark.browser
def test_timeline_plots_and_robot_move_together(
    planar: Rollout, planar_page: Path, watch: Callable[..., Watched]
) -> None:
    watched = exported(watch, planar_page, at="#t=2")
    page = watched.page
    assert page.evaluate("[player.time, player.playing]") == [2.0, False]
    width = page.evaluate(WIDTH)

    def expect(moment: float) -> None:
        at = moment / 4.0 * width
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

    # A click in a plot seeks there; the cursor can be dragged.
    box = page.locator("#side .u-over").nth(1).bounding_box()
    page.mouse.click(box["x"] + 0.25 * width, box["y"] + 40)
    assert page.evaluate("player.time") == pytest.approx(1.0, abs=0.02)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * width, box["y"] + 45, steps=3)
    page.mouse.up()
    released = page.evaluate("player.time")
    assert released == pytest.approx(2.0, abs=0.02)
    page.mouse.move(box["x"] + 1, box["y"] + 40)
    assert page.evaluate("player.time") == released

    # Playing moves all cursors.
    page.keyboard.press("Space")
    watched.until("player.time > 2.2")
    page.keyboard.press("Space")
    expect(page.evaluate("player.time"))
    page.evaluate("location.hash = '#t=0.5'")
    watched.until("player.time === 0.5")
    expect(0.5)


@pytest.mark.slow
@pytest.mark.browser
def test_a_page_has_its_bands_and_presents(
    planar: Rollout, tmp_path: Path, watch: Callable[..., Watched]
) -> None:
    """On a dark background, without light remains."""
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


def row(watched: Watched, name: str) -> Any:
    return watched.page.locator("#layers button").get_by_text(name, exact=True)


def states(watched: Watched) -> dict[str, bool]:
    """The active rows of the legend."""
    return watched.page.evaluate(
        """() => {
          const all = document.querySelectorAll("#layers button");
          const rows = [...all].filter(({dataset}) => !dataset.view);
          const state = (row) => row.getAttribute("aria-pressed") === "true";
          return Object.fromEntries(rows.map((row) => [row.textContent, state(row)]));
        }"""
    )


def orange(watched: Watched) -> int:
    """Number of pixels in the colour of obstacles."""
    image = watched.picture()
    red, green, blue = np.moveaxis(image, 2, 0)
    return int(((red > 190) & (green < 150) & (green > 70) & (blue < 90)).sum())


@pytest.mark.slow
@pytest.mark.browser
def test_a_row_of_the_legend_switches_its_objects(
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
        "axes": False,  # of the frames
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
    # Keys reach the player again after a click, and stay with a focused row.
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
    page.keyboard.press("f")
    assert states(watched)["axes"]
    assert page.evaluate("node('/frames/here/tip').visible")


# -- the live view --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.browser
def test_the_live_view_has_the_run_s_plots(
    planar: Rollout, watch: Callable[..., Watched]
) -> None:
    """During a run and after it; they keep the user's settings."""
    experiment = load_experiment(PLANAR, "simulation.duration=2")
    partial: list[Any] = []

    def on_row(recorder: Any) -> None:
        live.on_row(recorder)
        if not partial and recorder.rows(0)["t"][-1] >= 0.5:
            assert viewer.wait_for_browser(200.0)
            partial.append(watched.page.evaluate(END))
            watched.page.locator("#side .plot button").first.click()

    with Viewer(experiment.robot) as viewer:
        watched = watch(viewer.url)
        page = watched.page
        live = LiveView(viewer, experiment)
        assert not page.locator("#side").is_visible()  # there is no run yet
        log = experiment.run(on_row=on_row)
        assert partial == [2]  # the axis spans the whole run
        live.finish(log)
        assert viewer.wait_for_browser(200.0)
        assert page.locator("#side .plot").count() == 7
        alone = page.locator("#side .plot button").first.get_attribute("aria-pressed")
        assert alone == "true"

        # One command per frame of the plots: the newest replaces the previous one.
        kept = [
            name for path, name, _ in viewer.transport.scene.items() if path == PLOTS
        ]
        assert kept == ["plots"]
        width = page.evaluate(WIDTH)
        for moment in (0.5, 1.625):
            seek(watched, moment)
            at = moment / 2.0 * width
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
        page.close()  # a page that outlives its server would log a request as an error


# -- films ----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.browser
def test_a_film_shows_its_moments_and_is_the_same_again(
    planar: Rollout, browser: Any, tmp_path: Path
) -> None:
    del browser  # there is one
    style = FilmStyle(size=(320, 240), frame_rate=5.0, speed=4.0, plots=False)
    names = "a.gif", *further("b.gif")  # `test_the_arm_is_drawn_and_moves` draws again
    done: list[float] = []
    first, *others = (
        export_film(planar, tmp_path / name, style=style, progress=done.append)
        for name in names
    )
    assert all(again.read_bytes() == first.read_bytes() for again in others)
    assert done == [k / 6 for k in range(1, 7)] * len(names)
    with Image.open(first) as film:
        frames = [np.asarray(f.convert("RGB")) for f in ImageSequence.Iterator(film)]
        assert film.size == (320, 240)
        assert film.info["duration"] == 200
        assert film.info["loop"] == 0
    assert len(frames) == 6
    for one, two in itertools.pairwise(frames):
        assert (np.abs(one.astype(int) - two).max(axis=2) > 40).sum() > 200
    assert {file.name for file in tmp_path.iterdir()} == {*names}


@pytest.mark.slow
@pytest.mark.browser
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
    reported = subprocess.run(
        [find_ffmpeg(), "-hide_banner", "-i", str(films[0]), "-f", "null", "-"],
        capture_output=True,
        text=True,
        check=True,
    ).stderr
    assert "Video: h264" in reported
    assert "302x200" in reported  # H.264 requires even sizes
    assert "Duration: 00:00:01.25" in reported
    with Image.open(films[1]) as film:
        assert (film.format, film.size) == ("WEBP", (301, 200))
        assert film.n_frames == 5
