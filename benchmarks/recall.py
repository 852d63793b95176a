"""What an index finds of what comparing the whole map would find.

    python benchmarks/recall.py FOLDER --recordings ../data  # recorded drives and a rendered one
    python benchmarks/recall.py FOLDER --map 1000000         # a map that `benchmarks/million.py` made in FOLDER

On recordings: of how many images the most similar reference (selective match, 36 headings) is among so many from the
index. On a large map: how many of the hundred best, by the match and by the distance of the vectors that the index
holds codes of, and how similar the best hundred of what was found are.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.large_map import RENDERED, views
from omninav.pipeline.engine.artifact import read_artifact
from omninav.stages.candidates.appearance_vectors import appearance_vectors
from omninav.stages.candidates.exact_search import ExactSearch, short_vectors
from omninav.stages.candidates.index import LISTS, search_in
from omninav.stages.geometry.appearance.segments import similarities, turned_views
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.reference_index import ReferenceIndex

HEADINGS, BEST, BLOCK, QUERIES = 36, 100, 1 << 15, 24
ASKED = (1000, 3000, 4800)
RECORDED = {
    "house": ("log={}/photoreal-house/tour.mcap", "log={}/photoreal-house/drive.mcap"),
    "Sussex": ("log=sussex_training:{}/sussex-outdoor-route", "log=sussex_repeat:{}/sussex-outdoor-route"),
    "AntWorld": ("log=antworld:{}/antworld-rendered/ant1_route1", "log=antworld:{}/antworld-rendered/ant1_route2"),
}


def similar(map: ReferenceGraph, view: np.ndarray, rows: slice | np.ndarray) -> np.ndarray:
    """Selective similarity of references at their best headings."""
    return similarities(map.features[rows], view, HEADINGS, "histograms").max(axis=1)


def vectors_of(view: np.ndarray) -> np.ndarray:
    """A view at all headings as vectors."""
    return appearance_vectors(turned_views(view, HEADINGS), "histograms")


def on_recording(map: ReferenceGraph, drive: ReferenceGraph) -> list[float]:
    """Shares of images whose best reference is among 10, 50, 128 and 200 from the index."""
    search = ExactSearch(short_vectors(map, len(map), 128))
    hits = []
    for view in drive.features[np.linspace(0, len(drive) - 1, min(len(drive), 200)).astype(int)]:
        best, asked = int(np.argmax(similar(map, view, slice(None)))), vectors_of(view)
        hits.append([best in search.nearest(asked, number) for number in (10, 50, 128, 200)])
    return [float(share) for share in np.mean(hits, axis=0)]


def in_large_map(folder: Path, references: int) -> dict[int, list[float]]:
    """Recall of the hundred best and of the best, in a map that is too large to be compared whole at every image."""
    map, index = read_artifact(folder / f"{references}.omap"), read_artifact(folder / f"{references}.index")
    assert isinstance(map, ReferenceGraph)
    assert isinstance(index, ReferenceIndex)
    drive, search = views(folder, "drive", *RENDERED["drive"]), search_in(index)
    asked = [np.asarray(drive.features[n]) for n in np.linspace(0, len(drive) - 1, QUERIES).astype(int)]
    alike, near = (np.empty((QUERIES, references), np.float32) for _ in range(2))
    for start in range(0, references, BLOCK):
        rows = slice(start, min(start + BLOCK, references))
        vectors = appearance_vectors(map.features[rows], "histograms")
        for query, view in enumerate(asked):
            alike[query, rows] = similar(map, view, rows)
            turns = vectors_of(view)
            squares = np.square(turns).sum(axis=1) - 2 * (vectors @ turns.T)
            near[query, rows] = squares.min(axis=1) + np.square(vectors).sum(axis=1)
    shares: dict[int, list[list[float]]] = {number: [] for number in ASKED}
    for view, own, gap in zip(asked, alike, near, strict=True):
        best, closest = np.argsort(-own, kind="stable")[:BEST], np.argsort(gap, kind="stable")[:BEST]
        for number, each in shares.items():
            found = search.nearest(vectors_of(view), number, LISTS)
            reached = np.sort(own[found])[::-1][:BEST].mean() / own[best].mean()
            each.append([best[0] in found, np.isin(best, found).mean(), np.isin(closest, found).mean(), reached])
    return {number: np.mean(rows, axis=0).tolist() for number, rows in shares.items()}


def main() -> int:
    """Print shares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recordings", type=Path)
    parser.add_argument("--map", type=int)
    words = parser.parse_args()
    words.folder.mkdir(parents=True, exist_ok=True)
    if words.map:
        print("| asked for | the best | hundred best | hundred nearest vectors | similarity of the hundred found |")
        print("|---|---|---|---|---|")
        for number, shares in in_large_map(words.folder, words.map).items():
            print(f"| {number} | {' | '.join(f'{100 * share:.2f} %' for share in shares)} |")
    if words.recordings:
        drives = {"simulator": (RENDERED["tour"], RENDERED["drive"])}
        for name, logs in RECORDED.items():
            drives[name] = tuple((log.format(words.recordings),) for log in logs)  # type: ignore[assignment]
        print("| | references | images | among 10 | among 50 | among 128 | among 200 |\n|---|---|---|---|---|---|---|")
        for name, (tour, drive) in drives.items():
            simulated = name == "simulator"
            map = views(words.folder, "tour" if simulated else f"{name}_tour", *tour)
            seen = views(words.folder, "drive" if simulated else f"{name}_drive", *drive)
            shares = " | ".join(f"{100 * share:.1f} %" for share in on_recording(map, seen))
            print(f"| {name} | {len(map)} | {min(len(seen), 200)} | {shares} |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
