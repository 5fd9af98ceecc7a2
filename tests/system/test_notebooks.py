"""The notebooks run, say what they say without a warning, and are kept without output.

Each is executed once, in a kernel of its own as Jupyter would, in a folder of its own.
"""

import base64
import json
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from places import ROOT
from traitlets.config import Config

pytestmark = pytest.mark.process

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))

NAMES = [path.stem for path in NOTEBOOKS]
CELL_TIME = 120  # [s]: kernels may have to be compiled

ANSI = re.compile(r"\x1b\[[0-9;]*m")


def read(name: str) -> Any:
    return nbformat.read(ROOT / "notebooks" / f"{name}.ipynb", as_version=4)


def execute(notebook: Any, folder: Path) -> None:
    """Run all cells; the kernel listens on files, so that no port is opened."""
    beside = str(Path(sys.executable).parent)  # where `hsp` is
    environment = os.environ | {
        "PATH": os.pathsep.join([beside, os.environ["PATH"]]),
        "PYTHONPATH": str(ROOT),
        "MPLBACKEND": "module://matplotlib_inline.backend_inline",
        "IPYTHONDIR": str(folder / "ipython"),
    }
    environment.pop("NUMBA_DISABLE_JIT", None)  # no coverage comes from a kernel
    with tempfile.TemporaryDirectory() as sockets:  # whose names may not be long
        config = Config()
        config.KernelManager.transport = "ipc"
        config.KernelManager.ip = str(Path(sockets) / "kernel")
        NotebookClient(
            notebook,
            timeout=CELL_TIME,
            startup_timeout=60,
            kernel_name="python3",
            resources={"metadata": {"path": str(folder)}},
            config=config,
        ).execute(env=environment)


def outputs(notebook: Any) -> list[Any]:
    return [out for cell in notebook.cells for out in cell.get("outputs", [])]


def printed(notebook: Any) -> str:
    streams = (o for o in outputs(notebook) if o.output_type == "stream")
    return ANSI.sub("", "".join(o.text for o in streams if o.name == "stdout"))


def pictures(notebook: Any) -> list[bytes]:
    found = (o.data.get("image/png") for o in outputs(notebook) if "data" in o)
    return [base64.b64decode(picture) for picture in found if picture]


# ------------------------------------------------------------------ what they promise


def the_law(said: str) -> None:
    (torque,) = re.findall(r"relative difference in torque: (\S+)", said)
    assert float(torque) < 1e-10
    errors = re.findall(r"\|e - predicted\| ≤ (\S+) m", said)
    assert len(errors) == 3
    assert max(map(float, errors)) < 1e-11
    departures = re.findall(r"departure from the exponential (\S+)", said)
    assert len(departures) == 3
    assert max(map(float, departures)) < 1e-5
    minima = re.findall(r"law: \[(.*?)\].*difference (\S+) rad", said)
    assert len({minimum for minimum, _ in minima}) == 2  # one elbow up, one down
    assert max(float(difference) for _, difference in minima) < 1e-5


def panda_fields(said: str) -> None:
    without, with_field = (float(x) for x in re.findall(r"Jᵀ\) ≥ (\S+),", said))
    assert with_field > 5.0 * without
    a_field_keeps_clear(said)
    assert "did you mean 'panda_tcp'?" in said


def your_robot(said: str) -> None:
    a_field_keeps_clear(said)
    assert "shelf.yaml: OK" in said
    assert "did you mean 'gain'?" in said
    assert "malformed XML" in said


def command_it_now(said: str) -> None:
    errors = [float(x) for x in re.findall(r"within (\S+) mm of the reference", said)]
    assert len(errors) == 2
    assert max(errors) < 0.5
    assert "at the end 0.00 m/s" in said
    assert "StreamError · value contains nan" in said
    stretched = re.findall(r"N/m: (\S+) mm, F/K = (\S+) mm", said)
    assert len(stretched) == 2
    for moved, promised in stretched:
        assert abs(float(moved) / float(promised) - 1.0) < 0.03
    (largest,) = re.findall(r"effort in 10 ms: (\S+) N·m", said)
    assert float(largest) < 20.0


def a_field_keeps_clear(said: str) -> None:
    without, with_field = (float(x) for x in re.findall(r"nearest (\S+) mm", said))
    assert without < -20.0
    assert with_field > 20.0


PROMISES = {
    "01_the_law": the_law,
    "02_panda_fields": panda_fields,
    "03_your_robot": your_robot,
    "04_command_it_now": command_it_now,
}


@pytest.mark.timeout(400)
@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_runs_and_keeps_its_promises(name: str, tmp_path: Path) -> None:
    """Without a warning, with its figures inline and light, and with true numbers.

    One test, so that two workers do not run the same notebook.
    """
    notebook = read(name)
    execute(notebook, tmp_path)
    for out in outputs(notebook):
        if out.output_type == "stream":
            assert out.name == "stdout", f"{name} wrote to stderr: {out.text}"
        elif "InlineView" in out.data.get("text/plain", ""):
            page = out.data["text/html"]
            assert page.startswith("<iframe srcdoc=")
            assert len(page) < 2_000_000
        else:
            # A mere object as a cell's value is a semicolon forgotten.
            assert "image/png" in out.data, out.data
    shown = pictures(notebook)
    assert len(shown) >= 3
    assert all(picture.startswith(b"\x89PNG") for picture in shown)
    assert sum(map(len, shown)) < 1_500_000
    PROMISES[name](printed(notebook))


def test_a_cell_that_fails_fails_the_test(tmp_path: Path) -> None:
    notebook = nbformat.v4.new_notebook()
    notebook.cells = [nbformat.v4.new_code_cell("import hsp_control\n1 / 0")]
    with pytest.raises(CellExecutionError, match="ZeroDivisionError"):
        execute(notebook, tmp_path)


# ----------------------------------------------------------------------- as they stand


def test_there_are_four_and_documents_lead_to_them() -> None:
    assert list(PROMISES) == NAMES
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for name in NAMES:
        assert f"(notebooks/{name}.ipynb)" in readme


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_is_kept_without_outputs(name: str) -> None:
    path = ROOT / "notebooks" / f"{name}.ipynb"
    text = path.read_text(encoding="utf-8")
    kept = json.loads(text)
    nbformat.validate(kept)
    assert text == json.dumps(kept, indent=1, ensure_ascii=False) + "\n"
    assert set(kept["metadata"]) == {"kernelspec", "language_info"}
    for cell in kept["cells"]:
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None
        assert cell["metadata"] == {}


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_tells_a_story_and_ends_in_exercises(name: str) -> None:
    cells = read(name).cells
    assert cells[0].cell_type == "markdown"
    assert cells[0].source.startswith("# ")
    assert cells[-1].cell_type == "markdown"
    assert cells[-1].source.startswith("## Exercises")
    assert len(re.findall(r"^\d\. ", cells[-1].source, re.MULTILINE)) >= 5


@pytest.mark.parametrize("name", NAMES)
def test_links_lead_somewhere(name: str) -> None:
    for cell in read(name).cells:
        if cell.cell_type == "markdown":
            for target in re.findall(r"\]\(([^)#]+)\)", cell.source):
                file = (
                    target if target.endswith((".md", ".ipynb")) else f"{target}.ipynb"
                )
                assert (ROOT / "notebooks" / file).exists(), target
