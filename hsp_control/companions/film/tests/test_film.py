"""Films: their frames, refusals, and messages about missing packages."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from wording import wording

from hsp_control import Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.common.errors import ExportError
from hsp_control.companions.film import FilmStyle, encoding, export_film, film
from hsp_control.companions.film.screenshots import frame_times

PLANAR = "paper/4_moving_obstacle"


@pytest.fixture(scope="module")
def planar() -> Rollout:
    return load_experiment(PLANAR, "simulation.duration=3").run()


def test_a_films_moments_are_evenly_spread() -> None:
    times = frame_times((0.0, 3.0), 30.0, 2.0)
    assert len(times) == 46
    np.testing.assert_allclose(np.diff(times), 2.0 / 30.0)
    assert times[-1] == pytest.approx(3.0)
    assert frame_times((0.0, 0.0), 30.0, 1.0).tolist() == [0.0]
    with pytest.raises(ExportError, match="900001 images"):
        frame_times((0.0, 3.0), 30.0, 1e-4)


@pytest.mark.parametrize(("name", "style", "message"), [
    ("film.mpg", FilmStyle(), r"must be one of \.mp4.* did you mean '\.mp4'"),
    ("film.mp4", FilmStyle(size=(10, 400)), "10x400 pixels: width and height must"),
    ("film.gif", FilmStyle(frame_rate=0.5), "frame rate 0.5 Hz"),
    ("film.gif", FilmStyle(frame_rate=0.0), "frame rate 0 Hz: must be between 1"),
    ("film.gif", FilmStyle(speed=0.0), "speed 0 must be positive"),
    ("film.gif",
     FilmStyle(start=2, end=1),
     "from 2 to 1 s: must lie within the run, 0 to"),
    ("film.gif", FilmStyle(end=3.5), "0 to 3.5 s: must lie within the run, 0 to 3 s"),
])  # fmt: skip
def test_a_film_that_cannot_be_is_refused(
    planar: Rollout, tmp_path: Path, name: str, style: FilmStyle, message: str
) -> None:
    with pytest.raises(ExportError, match=message):
        export_film(planar, tmp_path / name, style=style)


@pytest.mark.parametrize(("name", "size", "frame_rate"), [
    ("film.mp4", (1280, 720), 30.0),
    ("film.gif", (800, 450), 20.0),
    ("film.WebP", (800, 450), 20.0),
])  # fmt: skip
def test_films_for_a_page_or_a_message_are_smaller(
    name: str, size: tuple[int, int], frame_rate: float
) -> None:
    assert film._checked_format(Path(name), FilmStyle()) == (size, frame_rate)
    own = FilmStyle(size=(640, 360), frame_rate=25.0)
    assert film._checked_format(Path(name), own) == ((640, 360), 25.0)


@pytest.mark.slow
def test_missing_programs_for_films_are_reported_and_the_rest_continues(
    planar: Rollout,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = planar.save(tmp_path / "run.npz")
    wanted = [f"--{kind}={tmp_path / f'film.{kind}'}" for kind in ("mp4", "gif")]
    page = tmp_path / "page.html"
    command = ["export", str(log), f"--html={page}", *wanted]

    monkeypatch.setenv("HSP_BROWSER", "no-such-browser")
    assert main(command) == 2
    reported = capsys.readouterr()
    assert "page.html" in reported.out
    assert page.is_file()
    assert reported.err.count("hsp: ") == 1  # once, not once per film
    assert re.search(
        r"no-such-browser is not an executable; .*apt-get install chr", reported.err
    )

    monkeypatch.setitem(sys.modules, "playwright.sync_api", None)
    assert main(command) == 2
    assert "pip install 'hsp_control[film]'" in capsys.readouterr().err

    monkeypatch.setattr(encoding.shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert main(command) == 2
    assert "apt-get install ffmpeg" in capsys.readouterr().err
    assert sorted(file.name for file in tmp_path.iterdir()) == ["page.html", "run.npz"]


def test_ffmpeg_s_message_is_passed_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = tmp_path / "film.mp4"
    failed = pytest.raises(ExportError, match=r"film\.mp4: ffmpeg failed: ")
    with failed, encoding.encoder(film, 10.0) as take:
        take(b"no picture")
    monkeypatch.setattr(encoding, "find_ffmpeg", lambda: "/no/ffmpeg")
    failed = pytest.raises(ExportError, match="cannot write the film: No such file")
    with failed, encoding.encoder(film, 10.0):
        pass
    assert not list(tmp_path.iterdir())


def test_the_command_names_missing_arguments(
    planar: Rollout, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(planar.save(tmp_path / "run.npz"))
    assert main(["export", log, "--gif=film.mp4"]) == 2
    assert "--gif film.mp4: the name must end with .gif" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["export", log, "--gif=a.gif", "--size=800"])
    assert "'800' is not WIDTHxHEIGHT" in capsys.readouterr().err
    assert main(["export", log, log, "--gif", str(tmp_path / "a.gif")]) == 2
    reported = capsys.readouterr().err
    assert re.search(wording("hsp: ... one run ... 2 logs ... --html"), reported)
    assert not (tmp_path / "a.gif").exists()


def test_the_command_s_options_are_those_of_the_film(
    planar: Rollout, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    styles = list[FilmStyle]()

    def export(_: Rollout, path: Path, *, style: FilmStyle, **__: object) -> Path:
        styles.append(style)
        path.touch()
        return path

    monkeypatch.setattr(film, "export_film", export)
    log = str(planar.save(tmp_path / "run.npz"))
    command = ["export", log, f"--gif={tmp_path / 'a.gif'}"]
    assert main(command) == 0
    own = ["--size=320x240", "--fps=5", "--speed=2", "--from=1", "--to=2"]
    assert main([*command, *own, "--no-plots"]) == 0
    assert main([*command, *own, "--no-caption"]) == 0
    some = FilmStyle((320, 240), 5.0, 2.0, start=1.0, end=2.0)
    without = some._replace(plots=False), some._replace(caption=False)
    assert styles == [FilmStyle(), *without]
