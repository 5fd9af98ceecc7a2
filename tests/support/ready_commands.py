"""A process that has imported `hsp_control` forks one for every command or script.

A command still begins without types, robots or logs of another one and ends
independently; this saves the CPU time of its imports and first checks, 1 to 2 s. The
start of `hsp` itself is tested by plays and by commands in a shell (`page_runner.py`).
"""

import atexit
import gc
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

PARTS = (
    *("hsp_control.cli.commands", "hsp_control.cli.live"),
    *("hsp_control.companions.viewer.command", "hsp_control.companions.viewer.pages"),
    *("hsp_control.companions.viewer.page_server", "hsp_control.companions.plots"),
    *("hsp_control.companions.plots.figures", "hsp_control.companions.plots.command"),
    *("hsp_control.companions.inspection.command", "hsp_control.companions.walking"),
    *("matplotlib.pyplot", "matplotlib.backends.backend_agg", "PIL.JpegImagePlugin"),
    *("tornado.platform.asyncio", "trimesh", "example_robot_data", "rich._emoji_codes"),
)
"""Modules that the process imports first, if present. None of them starts a thread."""


class ReadyCommands:
    """Runs commands of `hsp` and scripts, each in a fork of one process."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        atexit.register(self.close)

    def run(
        self, arguments: list[str], folder: Path, environment: dict[str, str]
    ) -> tuple[int, str]:
        """Return the status and the output of a command, or of a script ``name.py``."""
        try:
            return self._asked(
                {"arguments": arguments, "folder": str(folder), "env": environment}
            )
        # a timeout: otherwise the next one would receive its answer
        except BaseException:
            self.close()
            raise

    def _asked(self, request: dict[str, Any]) -> tuple[int, str]:
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-P", __file__], text=True, start_new_session=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            )  # fmt: skip
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        print(json.dumps(request), file=stdin, flush=True)
        status, printed = json.loads(stdout.readline())
        return status, printed

    def close(self) -> None:
        """End the process, and the command that it waits for."""
        if self._process is not None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.communicate()
            self._process = None


def serve() -> None:
    """Answer requests until there are no more."""
    from contextlib import suppress
    from importlib import import_module

    sys.argv[0] = "hsp"  # so that Ctrl-C ends it during imports, too
    import_module("hsp_control.cli")
    for part in PARTS:
        with suppress(ImportError):  # a removed companion
            import_module(part)
    from multiprocessing import get_context
    from tempfile import TemporaryFile

    # Each command would make the checks of these parts anew.
    for name in ("panda_obstacle", "paper/4_moving_obstacle"):
        import_module("hsp_control").load_experiment(name)
    # A command may have more packages.
    import_module("hsp_control.common.entry_points")._installed.cache_clear()
    requests, answers = os.fdopen(os.dup(0)), os.fdopen(os.dup(1), "w")
    fork = get_context("fork")
    gc.collect()
    gc.freeze()  # a collection would touch, and so copy, all pages
    for line in requests:
        with TemporaryFile() as printed:
            # Exits without finalising the interpreter, which would copy pages, too.
            child = fork.Process(
                target=_become, args=(json.loads(line), printed.fileno())
            )
            child.start()
            child.join()
            printed.seek(0)
            reported = printed.read().decode()
        print(json.dumps([child.exitcode, reported]), file=answers, flush=True)


def _become(request: dict[str, Any], output: int) -> None:
    """Run `python -m hsp_control` or `python name.py` in a folder, and end."""
    from runpy import run_path

    from hsp_control.cli import main

    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["env"])
    path = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[:0] = [request["folder"], *filter(None, path)]
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(output, 1)
    os.dup2(output, 2)
    first = request["arguments"][0]
    if first.endswith(".py"):
        sys.argv = request["arguments"]
        run_path(first, run_name="__main__")
        sys.exit()
    sys.exit(main(request["arguments"]))


if __name__ == "__main__":
    serve()
