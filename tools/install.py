"""Install packages into an environment: uv does it where pip can bring it, else pip.

``python tools/install.py FOLDER ARGUMENT ...`` creates the environment where it is
missing or broken; the arguments are those of ``pip install``. uv takes a sixth of pip's
time. It does not read pip's settings: those that say where packages come from, and in
which versions, are passed on. With a setting that has no equal there, and wherever uv
fails, pip installs.
"""

import ast
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

IN_UV = {
    "build-constraint": "UV_BUILD_CONSTRAINT",
    "cert": "SSL_CERT_FILE",
    "constraint": "UV_CONSTRAINT",
    "default-timeout": "UV_HTTP_TIMEOUT",
    "extra-index-url": "UV_INDEX",
    "find-links": "UV_FIND_LINKS",
    "index-url": "UV_DEFAULT_INDEX",
    "no-cache-dir": "UV_NO_CACHE",
    "proxy": "ALL_PROXY",
    "timeout": "UV_HTTP_TIMEOUT",
    "trusted-host": "UV_INSECURE_HOST",
}
"""pip's settings that decide what is installed, and uv's variables for them."""

NEEDLESS = {
    "break-system-packages",
    "cache-dir",
    "compile",
    "config-file",
    "disable-pip-version-check",
    "no-color",
    "no-input",
    "no-python-version-warning",
    "no-warn-script-location",
    "progress-bar",
    "quiet",
    "require-virtualenv",
    "retries",
    "root-user-action",
    "verbose",
}
"""pip's settings that change nothing of what is installed into an environment."""


def pip_settings(listing: str, environment: Mapping[str, str]) -> dict[str, str]:
    """Return what pip was told.

    Args:
        listing: What ``pip config list`` prints: lines like ``global.timeout='60'``.
        environment: The variables; ``PIP_...`` override the files.
    """
    found: dict[str, str] = {}
    for section in ("global.", "install."):
        for line in listing.splitlines():
            name, _, value = line.partition("=")
            if name.startswith(section):
                found[name.removeprefix(section)] = str(ast.literal_eval(value))
    for name, value in environment.items():
        if name.startswith("PIP_") and value:
            found[name.removeprefix("PIP_").lower().replace("_", "-")] = value
    return found


def uv_variables(settings: Mapping[str, str]) -> dict[str, str] | None:
    """Return pip's settings as uv's variables, None if one of them has no equal."""
    found = {}
    for name, value in settings.items():
        if name in IN_UV:
            separator = "," if name == "find-links" else " "
            found[IN_UV[name]] = separator.join(value.split())
        elif name not in NEEDLESS:
            return None
    if "UV_INDEX" in found:  # the best version of all indexes, as pip takes it
        found["UV_INDEX_STRATEGY"] = "unsafe-best-match"
    return found


def _succeeds(*command: str) -> bool:
    return not subprocess.run(command, capture_output=True, check=False).returncode


def _install_with_uv(pip: list[str], python: str, arguments: list[str]) -> bool:
    """Let uv install, from a folder that is gone afterwards; say whether it could."""
    told = subprocess.run(
        [*pip, "config", "list"], capture_output=True, text=True, check=False
    )
    variables = uv_variables(pip_settings(told.stdout, os.environ))
    if told.returncode or variables is None:
        return False
    environment = os.environ | variables
    place = Path(python).parents[1]
    with tempfile.TemporaryDirectory(prefix="uv-", dir=place) as folder:
        # --only-binary: on a platform without a wheel pip would have to compile it.
        get = ["install", "--quiet", "--only-binary=:all:", "--no-compile"]
        if not _succeeds(*pip, *get, "--target", folder, "uv"):
            return False
        command = [f"{folder}/bin/uv", "pip", "install", "--quiet", "--python", python]
        if sys.dont_write_bytecode:  # else the first import writes it, where needed
            command.append("--compile-bytecode")
        try:
            done = subprocess.run([*command, *arguments], env=environment, check=False)
        except OSError:  # this machine cannot execute it
            return False
        return done.returncode == 0


def main(folder: str, *arguments: str) -> int:
    """Create the environment if it is not there, and install what the arguments say."""
    python = f"{folder}/bin/python"
    ready = Path(python).exists() and _succeeds(python, "-m", "pip", "--version")
    own = [sys.executable, "-m", "pip"]
    if not ready:
        create = [sys.executable, "-m", "venv", "--clear", folder]
        # uv fills it sooner than ensurepip, which Debian's Python may not even have.
        ready = not _succeeds(*own, "--version")
        if not ready:
            create.append("--without-pip")
        if subprocess.run(create, check=False).returncode:
            print("Creating it needs python3-venv, or python3-pip.", file=sys.stderr)
            return 1
    pip = [python, "-m", "pip"] if ready else own
    if _install_with_uv(pip, python, ["pip", *arguments]):
        return 0
    print("uv cannot be used here; pip installs, which takes longer ...")
    if not ready and not _succeeds(python, "-m", "ensurepip"):
        _succeeds(*own, "--python", python, "install", "--quiet", "pip")
    install = [python, "-m", "pip", "install", "--quiet", *arguments]
    return subprocess.run(install, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
