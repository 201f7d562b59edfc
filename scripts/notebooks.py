#!/usr/bin/env python3
"""Makes Jupyter notebooks of the sources in docs/notebooks, and executes them.

    python3 scripts/notebooks.py FOLDER [--execute] [--small] [NAME ...]

The sources are Python with `# %%` before each cell (the percent format, which Jupytext, VS Code and Spyder open as they are). --execute, which needs
nbclient and ipykernel, stores the outputs too; --small takes coarse scenes and few pictures, as the test does. Each is reported with its seconds.
"""

import argparse
import json
import os
import sys
import time
from pathlib import Path

SOURCES = Path(__file__).parents[1] / "docs" / "notebooks"


def cells(text: str) -> list[dict[str, object]]:
    """Returns the cells of a source, as notebooks have them."""
    result: list[dict[str, object]] = []
    for number, part in enumerate(text.split("# %%")[1:]):
        head, _, body = part.partition("\n")
        lines = body.strip("\n")
        cell: dict[str, object] = {"id": f"cell-{number}", "metadata": {}}
        if head.strip() == "[markdown]":
            words = [line.removeprefix("#").removeprefix(" ") for line in lines.splitlines()]
            result.append({**cell, "cell_type": "markdown", "source": "\n".join(words)})
        else:
            result.append({**cell, "cell_type": "code", "execution_count": None, "outputs": [], "source": lines})
    return result


def notebook(source: Path) -> dict[str, object]:
    """Returns a source as a notebook without outputs."""
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return {"cells": cells(source.read_text(encoding="utf-8")), "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}


def executed(made: dict[str, object], folder: Path) -> dict[str, object]:
    """Returns a notebook with its outputs; raises what a cell raises."""
    import nbformat
    from nbclient import NotebookClient

    node = nbformat.from_dict(made)
    NotebookClient(node, timeout=3600, resources={"metadata": {"path": str(folder)}}).execute()
    return node


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--execute", action="store_true")
    parser.add_argument("--small", action="store_true")
    parser.add_argument("names", nargs="*")
    given = parser.parse_intermixed_args()
    if given.small:
        os.environ["DIOPTRIC_SMALL"] = "1"
    given.folder.mkdir(parents=True, exist_ok=True)
    sources = sorted(SOURCES.glob("*.py"))
    unknown = set(given.names) - {source.stem for source in sources}
    if unknown:
        sys.exit(f"error: there is no notebook '{sorted(unknown)[0]}' in {SOURCES}")
    for source in sources:
        if given.names and source.stem not in given.names:
            continue
        start = time.perf_counter()
        made = notebook(source)
        if given.execute:
            made = executed(made, SOURCES)
        target = given.folder / f"{source.stem}.ipynb"
        target.write_text(json.dumps(made, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        print(f"{target}: {time.perf_counter() - start:.1f} s, {target.stat().st_size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
