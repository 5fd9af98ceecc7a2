"""The notebooks run without a warning, and are stored with the output of a run.

Each is executed once, with the code of its answers, in another kernel as Jupyter
would, in another folder. Of the outputs text and small pictures are stored.
"""

import base64
import copy
import importlib.util
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import nbformat
import pytest
from places import ROOT, THOROUGH

pytestmark = [pytest.mark.process, pytest.mark.slow]

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))

NAMES = [path.stem for path in NOTEBOOKS]
USUAL = ["03_your_robot", "04_command_it_now"]
"""The others, of the law, of fields and of walking, take half a minute each and more,
and repeat what other tests prove: `make thorough`."""
NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?")
ANSWER = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def _load_tool() -> ModuleType:
    """Return tools/notebooks.py, which is a script."""
    path = ROOT / "tools" / "notebooks.py"
    spec = importlib.util.spec_from_file_location("notebooks_tool", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


tool = _load_tool()


def read(name: str) -> Any:
    return nbformat.read(ROOT / "notebooks" / f"{name}.ipynb", as_version=4)


def outputs(notebook: Any) -> list[Any]:
    return [out for cell in notebook.cells for out in cell.get("outputs", [])]


def printed(notebook: Any) -> str:
    streams = (o for o in outputs(notebook) if o.output_type == "stream")
    return "".join(o.text for o in streams if o.name == "stdout")


def with_answers(notebook: Any) -> Any:
    """Return a copy in which the code of the answers is another cell."""
    answered = copy.deepcopy(notebook)
    for code in ANSWER.findall(notebook.cells[-1].source):
        answered.cells.append(nbformat.v4.new_code_cell(code))
    return answered


def words(cell: Any) -> tuple[list[str], int]:
    """Return a cell's output without numbers, and the number of its pictures."""
    kept = cell.get("outputs", [])
    reported = "".join(out.text for out in kept if out.output_type == "stream")
    return NUMBER.sub("", reported).split(), sum("data" in out for out in kept)


def pictures(notebook: Any) -> list[bytes]:
    found = (o.data.get("image/png") for o in outputs(notebook) if "data" in o)
    return [base64.b64decode(picture) for picture in found if picture]


# ------------------------------------------------------------- what the texts promise


def the_law(reported: str) -> None:
    (torque,) = re.findall(r"relative difference in torque: (\S+)", reported)
    assert float(torque) < 1e-10
    errors = re.findall(r"\|e - predicted\| ≤ (\S+) m", reported)
    assert len(errors) == 3
    assert max(map(float, errors)) < 1e-11
    departures = re.findall(r"departure from the exponential (\S+)", reported)
    assert len(departures) == 3
    assert max(map(float, departures)) < 1e-5
    minima = re.findall(r"law: \[(.*?)\].*difference (\S+) rad", reported)
    assert len({minimum for minimum, _ in minima}) == 2  # one elbow up, one down
    assert max(float(difference) for _, difference in minima) < 1e-5


def panda_fields(reported: str) -> None:
    without, with_field = (float(x) for x in re.findall(r"Jᵀ\) ≥ (\S+),", reported))
    assert with_field > 5.0 * without
    a_field_keeps_clear(reported)
    assert "did you mean 'panda_tcp'?" in reported


def your_robot(reported: str) -> None:
    a_field_keeps_clear(reported)
    assert "shelf.yaml: OK" in reported
    assert "did you mean 'gain'?" in reported
    assert "malformed XML" in reported


def command_it_now(reported: str) -> None:
    errors = [
        float(x) for x in re.findall(r"within (\S+) mm of the reference", reported)
    ]
    assert len(errors) == 2
    assert max(errors) < 0.5
    assert "at the end 0.00 m/s" in reported
    assert "StreamError · tasks.hand: value contains nan" in reported
    stretched = re.findall(r"N/m: (\S+) mm, F/K = (\S+) mm", reported)
    assert len(stretched) == 2
    for moved, promised in stretched:
        assert abs(float(moved) / float(promised) - 1.0) < 0.03
    (largest,) = re.findall(r"effort in 10 ms: (\S+) N·m", reported)
    assert float(largest) < 20.0


def walking(reported: str) -> None:
    assert "completed: 0.5" in reported
    (away,) = re.findall(r"at most (\d+) mm from the plan", reported)
    assert float(away) < 30.0
    (median,) = re.findall(r"median ‖e_N‖ (\S+) rad/s", reported)
    assert float(median) < 0.1
    assert "completed, at the end 0.0" in reported
    rates = re.findall(r"measured (\S+) 1/s", reported)
    assert abs(float(rates[0]) - 6.0) < 0.6


def a_field_keeps_clear(reported: str) -> None:
    without, with_field = (float(x) for x in re.findall(r"nearest (\S+) mm", reported))
    assert without < -20.0
    assert with_field > 20.0


PROMISES = {
    "01_the_law": the_law,
    "02_panda_fields": panda_fields,
    "03_your_robot": your_robot,
    "04_command_it_now": command_it_now,
    "05_walking": walking,
}


@pytest.mark.timeout(400)
@pytest.mark.parametrize("name", NAMES if THOROUGH else USUAL)
def test_a_notebook_runs_and_keeps_its_promises(name: str, tmp_path: Path) -> None:
    """Each notebook runs without a warning; figures are inline and small, numbers true.

    One test, so that two workers do not run the same notebook.
    """
    stored = read(name)
    notebook = tool.executed(with_answers(stored), tmp_path)
    for out in outputs(notebook):
        if out.output_type == "stream":
            assert out.name == "stdout", f"{name} wrote to stderr: {out.text}"
        elif page := out.data.get("text/html"):
            assert page.startswith("<iframe srcdoc=")
            assert len(page) < 2_000_000
        else:
            # A bare object as a cell's value shows that a semicolon is missing.
            assert "image/png" in out.data, out.data
    shown = pictures(notebook)
    assert len(shown) >= 3
    assert all(picture.startswith(b"\x89PNG") for picture in shown)
    assert sum(map(len, shown)) < 1_500_000
    tool.keep_small(notebook, str(tmp_path))
    for kept, made in zip(stored.cells, notebook.cells, strict=False):
        assert words(kept) == words(made), "`make notebooks` writes the outputs anew"
    PROMISES[name](printed(notebook))
