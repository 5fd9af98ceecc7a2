"""A process that has imported `hsp_control` forks one for every command or script.

Each command still begins with no types, robots or logs of another one, and ends on its
own: what is saved is the CPU of its imports and first checks, a second or two. How
`hsp` itself starts is seen where plays and commands that need a shell run
(`page_runner.py`).
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
        """Return the status of a command, or of a script ``name.py``, and its words."""
        try:
            return self._asked(
                {"arguments": arguments, "folder": str(folder), "env": environment}
            )
        except BaseException:  # a time limit: the next one would get its answer
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

    sys.argv[0] = "hsp"  # as which Ctrl-C ends it during imports, too
    import_module("hsp_control.cli")
    for part in PARTS:
        with suppress(ImportError):  # a companion that was taken away
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
    gc.freeze()  # a fork that looked for garbage would copy all of it
    for line in requests:
        with TemporaryFile() as printed:
            # Ends without taking the interpreter apart, which would copy it, too.
            child = fork.Process(
                target=_become, args=(json.loads(line), printed.fileno())
            )
            child.start()
            child.join()
            printed.seek(0)
            said = printed.read().decode()
        print(json.dumps([child.exitcode, said]), file=answers, flush=True)


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
