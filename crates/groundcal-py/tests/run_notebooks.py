"""Runs the notebooks of docs/notebooks, each in a fresh kernel; an exception in a cell fails, and a notebook that shows nothing.

    python crates/groundcal-py/tests/run_notebooks.py [--write]

``--write`` keeps in the files what the cells gave, but for the page, which is large and made by who runs it.
"""

from __future__ import annotations

import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[3]


def main() -> int:
    folder = ROOT / "docs" / "notebooks"
    for path in sorted(folder.glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
        NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
        kinds = [kind for cell in notebook.cells for o in cell.get("outputs", []) for kind in o.get("data", {})]
        pictures, pages = sum(kind.startswith("image/") for kind in kinds), kinds.count("text/html")
        print(f"{path.name}: {len(notebook.cells)} cells, {pictures} pictures, {pages} pages")
        if pictures == 0 or pages == 0:
            print(f"{path.name}: shows nothing", file=sys.stderr)
            return 1
        if "--write" in sys.argv[1:]:
            for cell in notebook.cells:
                cell.metadata.pop("execution", None)
                for output in cell.get("outputs", []):
                    output.get("data", {}).pop("text/html", None)
            nbformat.write(notebook, path)  # type: ignore[no-untyped-call]
    return 0


if __name__ == "__main__":
    sys.exit(main())
