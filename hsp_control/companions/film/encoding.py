"""Encodes images to a film with ffmpeg."""

import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

from hsp_control.common.errors import ExportError

_EVEN = "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white"
_PALETTE = (
    "split[a][b];[a]palettegen=stats_mode=diff:max_colors={colors}[p];"
    "[b][p]paletteuse=dither=bayer:bayer_scale=5:diff_mode=rectangle"
)
FORMATS = {
    ".mp4": (
        *("-f", "mp4", "-c:v", "libx264", "-preset", "slow", "-crf", "20"),
        *("-pix_fmt", "yuv420p", "-vf", _EVEN, "-movflags", "+faststart"),
    ),
    ".gif": ("-f", "gif", "-filter_complex", _PALETTE.format(colors=160), "-loop", "0"),
    ".webp": (
        *("-f", "webp", "-c:v", "libwebp_anim", "-quality", "80", "-loop", "0"),
        *("-compression_level", "5", "-pix_fmt", "yuv420p"),
    ),
}
"""ffmpeg's output options by the file's extension."""


def find_ffmpeg() -> str:
    """Return the path of ffmpeg: the system's, or else that of imageio-ffmpeg."""
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise ExportError(
            "a film needs ffmpeg, and none is found on the path; install it "
            "(on Debian: apt-get install ffmpeg; anywhere: pip install imageio-ffmpeg)"
        ) from None


def _write(pipe: IO[bytes], image: bytes) -> None:
    pipe.write(image)


@contextmanager
def encoder(path: Path, frame_rate: float) -> Iterator[Callable[[bytes], None]]:
    """Yield a function that appends one image, a PNG file, to the film.

    The film is renamed to ``path`` once it is complete.
    """
    ffmpeg = find_ffmpeg()
    part = path.with_name(f".{path.name}.part")
    command = [
        *(ffmpeg, "-hide_banner", "-loglevel", "error", "-y"),
        *(
            "-f",
            "image2pipe",
            "-framerate",
            f"{frame_rate:g}",
            "-c:v",
            "png",
            "-i",
            "-",
        ),
        *("-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"),
        *FORMATS[path.suffix.lower()],
        str(part),
    ]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryFile() as messages:
            with subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=messages,
            ) as process:
                assert process.stdin is not None
                with suppress(BrokenPipeError):  # ffmpeg's own message follows
                    yield partial(_write, process.stdin)
                    process.stdin.close()
            if process.returncode != 0:
                messages.seek(0)
                lines = messages.read().decode(errors="replace").strip().splitlines()
                reason = lines[-1] if lines else f"exit status {process.returncode}"
                raise ExportError(f"{path}: ffmpeg failed: {reason}")
        part.replace(path)
    except OSError as error:
        raise ExportError(
            f"{path}: cannot write the film: {error.strerror or error}"
        ) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
