"""Runs the notebooks of docs/notebooks from a fresh kernel; what they give is compared with nothing, an exception in a cell fails.

    python crates/groundcal-py/tests/run_notebooks.py [--out FOLDER]

``--out`` writes them there with what their cells gave. Those of the repository have none: pictures and pages are made by who runs them.
"""

from __future__ import annotations

import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[3]


def main() -> int:
    folder = ROOT / "docs" / "notebooks"
    out = Path(sys.argv[2]) if sys.argv[1:2] == ["--out"] else None
    for path in sorted(folder.glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
        kinds = [kind for cell in notebook.cells for o in cell.get("outputs", []) for kind in o.get("data", {})]
        print(f"{path.name}: {len(notebook.cells)} cells, {kinds.count('image/png')} pictures, {kinds.count('text/html')} pages")
        if kinds.count("image/png") == 0 or kinds.count("text/html") == 0:
            print(f"{path.name}: shows nothing", file=sys.stderr)
            return 1
        if out is not None:
            nbformat.write(notebook, out / path.name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
