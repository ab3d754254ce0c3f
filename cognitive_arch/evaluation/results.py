"""What is made of the rows of a sweep: parquet, summary, comparisons, figures, and a page with all that."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from cognitive_arch.errors import SweepError, one_line
from cognitive_arch.evaluation import figures, page
from cognitive_arch.evaluation.rows import ROWS, read_manifest
from cognitive_arch.evaluation.summary import compare, summarise


class Results(NamedTuple):
    """Rows, what they say, and the files that were written."""

    rows: pd.DataFrame
    summary: pd.DataFrame
    comparisons: pd.DataFrame
    files: tuple[Path, ...]


def read_rows(folder: Path) -> pd.DataFrame:
    """All rows of a sweep, one per episode (columns as `rows.Row`); raises `SweepError`."""
    path = folder / ROWS
    try:
        return pd.read_csv(path)
    except FileNotFoundError:
        raise SweepError(f"{folder} holds no rows: there is no {ROWS}") from None
    except (OSError, ValueError) as error:
        raise SweepError(f"{path} cannot be read: {one_line(error)}") from None


def write_results(folder: Path, beside: Sequence[Path] = (), intro: str = "", title: str = "") -> Results:
    """Everything in `folder` that follows from its rows; `beside` are other sweeps in the same figures.

    The same rows give the same bytes, but for times. Raises `SweepError` if that cannot be written.
    """
    manifest = read_manifest(folder)
    rows = read_rows(folder)
    try:
        return _write(folder, manifest, rows, beside, intro, title)
    except OSError as error:
        raise SweepError(
            f"cannot write the results into {folder}: {error.strerror or one_line(error)}"
        ) from None


def _write(
    folder: Path, manifest: dict[str, Any], rows: pd.DataFrame, beside: Sequence[Path], intro: str, title: str
) -> Results:
    seed = int(manifest["config"]["seed"])
    summary, comparisons = summarise(rows, seed), compare(rows, seed)
    files = [folder / "rows.parquet", folder / "summary.csv", folder / "comparisons.csv"]
    rows.to_parquet(files[0], index=False)
    summary.to_csv(files[1], index=False, lineterminator="\n")
    comparisons.to_csv(files[2], index=False, lineterminator="\n")
    shown = pd.concat([rows, *(read_rows(other) for other in beside)], ignore_index=True)
    told = summarise(shown, seed) if beside else summary
    drawings = folder / "figures"
    drawings.mkdir(exist_ok=True)
    pictures = []
    for drawn in figures.draw_all(shown, told):
        png, svg = figures.save(drawn, drawings)
        files += [png, svg]
        pictures.append((svg, drawn.caption))
    title = title or "Noise sweep: " + ", ".join(sorted(set(shown["scene"])))
    tables = [("Summary", told.drop(columns=["left", "right", "pull", "push"])), ("In pairs", comparisons)]
    files.append(folder / "index.html")
    files[-1].write_text(page.page(title, manifest, pictures, tables, intro), encoding="utf-8")
    return Results(rows, summary, comparisons, tuple(files))
