"""Commands write to any stdout: none, ASCII only, or a closed pipe."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from places import covering

from hsp_control import load_experiment
from hsp_control.common.errors import (
    ConfigError,
    LogError,
    StreamError,
)
from hsp_control.declaration.imported import import_file
from hsp_control.simulation import Rollout
from hsp_control.simulation.journal import JournalReader
from hsp_control.trajectories.streams.sources import read_recording

CODE = """
import os, sys
sys.argv = ["hsp"]
{before}
from hsp_control.cli.streams import make_usable
make_usable()
print("\u00b5 \u2264", flush=True)
print("\u00b5", file=sys.stderr, flush=True)
descriptor = os.open(os.devnull, os.O_RDONLY)
sys.exit(7 if descriptor > 2 and sys.stdin.read() == "" else 3)
"""


@pytest.mark.parametrize(
    ("closed", "encoding"),
    covering([(), (1,), (2,), (1, 2), (0, 1, 2)], ["ascii", "utf-8", "latin-1"]),
)
@pytest.mark.process
@pytest.mark.smoke
def test_any_text_can_be_written(closed: tuple[int, ...], encoding: str) -> None:
    def close() -> None:
        for number in closed:
            os.close(number)

    done = subprocess.run(
        [sys.executable, "-c", CODE.format(before="")],
        env={**os.environ, "PYTHONIOENCODING": encoding},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        preexec_fn=close,
        check=False,
    )
    assert done.returncode == 7, done.stderr.decode()
    if 1 not in closed:
        expected = {"ascii": b"? ?", "latin-1": b"\xb5 ?"}
        assert done.stdout.strip() == expected.get(encoding, "\u00b5 \u2264".encode())


@pytest.mark.process
@pytest.mark.smoke
def test_a_configuration_whose_name_is_not_utf8_is_run(tmp_path: Path) -> None:
    name = b"caf\xe9.yaml".decode(errors="surrogateescape")
    short = "robot: {name: planar3r}\ntasks: {}\nsimulation: {duration: 0.01}\n"
    (tmp_path / name).write_text(short)
    done = subprocess.run(
        [sys.executable, "-m", "hsp_control", "run", name],
        env={**os.environ, "PYTHONIOENCODING": "utf-8:strict"},
        cwd=tmp_path,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    assert done.stdout.decode().endswith("Log: out/caf\\udce9.npz\n")
    log = Rollout.load(tmp_path / "out" / Path(name).with_suffix(".npz"))
    assert log.meta["name"] == Path(name).stem


LONG = """
import sys
from hsp_control.cli.streams import lost_text, make_usable
make_usable()
make_usable()
for k in range(10_000):
    print("a line that fills the buffer of a pipe", k, flush=k % 2 == 0)
print("done", lost_text(), file=sys.stderr)
"""


@pytest.mark.parametrize("where", ["pipe", "/dev/full"])
@pytest.mark.process
@pytest.mark.smoke
def test_a_command_continues_when_its_output_is_closed(where: str) -> None:
    """A run is kept although the reader of its summary has closed the pipe."""
    if where == "pipe":
        reader, writer = os.pipe()
        os.close(reader)
    else:
        writer = os.open(where, os.O_WRONLY)
    command = [sys.executable, "-c", LONG]
    try:
        done = subprocess.run(
            command, stdout=writer, stderr=subprocess.PIPE, text=True, check=True
        )
    finally:
        os.close(writer)
    why = "None" if where == "pipe" else "No space left on device"
    assert done.stderr == f"done {why}\n"


@pytest.mark.parametrize(("where", "status"), [("/dev/full", 2), ("/dev/null", 0)])
@pytest.mark.parametrize("words", ["robots panda", "run --help", "--version", ""])
@pytest.mark.process
@pytest.mark.smoke
def test_the_status_reports_whether_all_was_written(
    words: str, where: str, status: int
) -> None:
    with Path(where).open("w") as file:
        command = [sys.executable, "-m", "hsp_control", *words.split()]
        done = subprocess.run(command, stdout=file, stderr=subprocess.PIPE, text=True)
    reported = "hsp: standard output: No space left on device" if status else ""
    assert (done.returncode, done.stderr.strip()) == (status, reported)


@pytest.mark.process
@pytest.mark.smoke
def test_the_schema_needs_no_docstrings() -> None:
    code = "from hsp_control.config.scenario import json_schema; json_schema()"
    subprocess.run([sys.executable, "-OO", "-c", code], check=True)


@pytest.mark.parametrize("kind", ["fifo", "device", "kernel"])
def test_endless_inputs_are_no_log_and_no_recording(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    if kind == "fifo":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero" if kind == "device" else "/proc/kmsg")
    which = "a file of the kernel" if kind == "kernel" else "a device or a pipe"
    with pytest.raises(LogError, match=f"{which}, which may never end; no log"):
        Rollout.load(path)
    with pytest.raises(LogError, match="is not a journal"):
        JournalReader(path).read()
    with pytest.raises(StreamError, match=f"{which}, which may never end; no rec"):
        read_recording(path)
    with pytest.raises(ConfigError, match=which):
        load_experiment(path.rename(path.with_suffix(".yaml")))
    with pytest.raises(ConfigError, match=rf"{which}, .*; needs a \.py file"):
        import_file(path.with_suffix(".yaml").rename(path.with_suffix(".py")))
