"""Run the notebooks and store their output: `make notebooks`.

    .venv/bin/python tools/notebooks.py [NAME ...]

Text and small pictures are stored, so that a notebook can be read without running it.
Views, numbers of executions, paths of this machine and colours of a terminal are not.
"""

import base64
import os
import re
import sys
import tempfile
from io import BytesIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

import nbformat
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "notebooks"

CELL_TIME = 240  # [s]: the first one imports
COLORS = 64
"""How many colours a picture keeps: enough for lines and their smooth edges."""

_ANSI = re.compile(r"\x1b\[[0-9;]*m")
_KEY = re.compile(r"\?key=\S+")  # of a page; it is another one for every user


def main() -> None:
    """Run the notebooks that are named, or all, and write them back."""
    for path in sorted(FOLDER.glob("*.ipynb")):
        if len(sys.argv) == 1 or path.stem in sys.argv[1:]:
            print(f"{path.name} ...", flush=True)
            notebook = nbformat.read(path, as_version=4)
            with tempfile.TemporaryDirectory() as folder:
                notebook = executed(notebook, Path(folder))
                keep_small(notebook, folder)
            nbformat.write(notebook, path)


def executed(notebook: Any, folder: Path) -> Any:
    """Return a notebook with all its cells run in a folder.

    Raises:
        RuntimeError: If a cell raises, or takes too long.
    """
    from nbmake.nb_run import NotebookRun  # tests that only read notebooks need it not

    file = folder / "notebook.ipynb"
    nbformat.write(notebook, file)
    beside = str(Path(sys.executable).parent)  # where `hsp` is
    environment = {
        "PATH": os.pathsep.join([beside, os.environ["PATH"]]),
        "PYTHONPATH": str(ROOT),
        "MPLBACKEND": "module://matplotlib_inline.backend_inline",
        "IPYTHONDIR": str(folder / "ipython"),
    }
    with patch.dict(os.environ, environment):
        found = NotebookRun(file, CELL_TIME).execute()
    if found.error is not None:
        raise RuntimeError(
            f"cell {found.error.failing_cell_index}: {found.error.trace}"
        )
    return found.nb


def keep_small(notebook: Any, folder: str) -> None:
    """Keep the portable outputs: text and pictures."""
    notebook.metadata = {
        "kernelspec": {
            "display_name": "Python 3",
            "language": "python",
            "name": "python3",
        },
        "language_info": {"name": "python"},
    }
    for cell in notebook.cells:
        cell.metadata = {}
        if cell.cell_type == "code":
            cell.execution_count = None
            cell.outputs = list(_kept(cell.outputs, folder))


def _kept(outputs: list[Any], folder: str) -> list[Any]:
    texts = [out.text for out in outputs if out.output_type == "stream"]
    text = _ANSI.sub("", "".join(texts)).replace("\r\n", "\n")
    text = _KEY.sub("", text).replace(f"{folder}/", "").replace(folder, "")
    kept = [nbformat.v4.new_output("stream", name="stdout", text=text)] if text else []
    pictures = (out.data.get("image/png") for out in outputs if "data" in out)
    for picture in filter(None, pictures):
        data = {"image/png": smaller(picture)}
        kept.append(nbformat.v4.new_output("display_data", data=data))
    return kept


def smaller(picture: str) -> str:
    """Return a PNG, as base64, with few colours."""
    image = Image.open(BytesIO(base64.b64decode(picture))).convert("RGB")
    few = image.quantize(
        COLORS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE
    )
    written = BytesIO()
    few.save(written, format="png", optimize=True)
    return base64.b64encode(written.getvalue()).decode()


if __name__ == "__main__":
    main()
