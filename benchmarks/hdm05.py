"""The archive of HDM05 that tests and benchmarks read, made from the files as they are downloaded.

    python benchmarks/hdm05.py FOLDER DATA_FOLDER/hdm05/hdm05_positions.npz

FOLDER holds, at any depth, the cut clips of HDM05 (``HDM_<actor>_<action>_<number>_120.amc``) and
the skeletons of its actors (``HDM_<actor>.asf``), from https://resources.mpi-inf.mpg.de/HDM05/. The
six actions and four actors of docs/accuracy.md are taken, 132 clips. The archive is what
`load_trials` describes, and the names of the files, in metres, y upwards, float32; it is a
derivative under the licence of HDM05, CC BY-SA 3.0.
"""

import argparse
import re
from pathlib import Path

import numpy as np
from sklearn_motionsync import Skeleton
from sklearn_motionsync.io import read_motion

ACTIONS = (
    "depositFloorR",
    "elbowToKnee1RepsLelbowStart",
    "grabHighR",
    "hopBothLegs1hops",
    "jogLeftCircle4StepsRstart",
    "sneak2StepsLStart",
)
ACTORS = ("bd", "bk", "dg", "tr")
NAME = re.compile(r"HDM_(?P<actor>[a-z]+)_(?P<label>\w+)_(?P<take>\d+)_(?P<fps>\d+)", re.ASCII)


def find_clips(folder):
    """The clips below a folder, by action and name, and what these say."""
    found = {}
    for path in sorted(Path(folder).rglob("*")):
        clip = NAME.fullmatch(path.stem) if path.suffix.lower() == ".amc" else None
        if clip and clip["label"] in ACTIONS and clip["actor"] in ACTORS:
            # The same clip may lie in several archives of the database.
            found.setdefault(path.name.lower(), (clip["label"], path.name, path, clip.groupdict()))
    return [(path, facts) for _, _, path, facts in sorted(found.values(), key=lambda c: c[:2])]


def find_skeletons(folder):
    """The skeletons below a folder, by actor."""
    paths = [p for p in sorted(Path(folder).rglob("HDM_*")) if p.suffix.lower() == ".asf"]
    return {path.stem.removeprefix("HDM_"): path for path in paths}


def read_clips(folder):
    """The arrays of the archive."""
    clips, skeletons = find_clips(folder), find_skeletons(folder)
    if not clips:
        raise SystemExit(
            f"There are no clips HDM_<actor>_<action>_<number>_120.amc of the actions {ACTIONS} "
            f"and the actors {ACTORS} below {folder}; download them as docs/benchmarks.md says."
        )
    if missing := sorted({facts["actor"] for _, facts in clips} - set(skeletons)):
        raise SystemExit(f"The skeletons {[f'HDM_{m}.asf' for m in missing]} are not in {folder}.")
    body, positions = Skeleton.acclaim(), []
    for path, facts in clips:
        df = read_motion(path, asf=skeletons[facts["actor"]])
        positions.append(df[body.column_names].to_numpy(np.float32).reshape(len(df), -1, 3))
    return {
        "positions": np.concatenate(positions),
        "offsets": np.cumsum([0, *map(len, positions)]),
        **{key: np.array([facts[key] for _, facts in clips]) for key in ("label", "actor", "take")},
        "source": np.array([path.name for path, _ in clips]),
        "fps": np.array([float(facts["fps"]) for _, facts in clips]),
        "joints": np.array(body.joints),
        "parents": np.array(body.parents),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("output", type=Path)
    args = parser.parse_args()
    arrays = read_clips(args.folder)
    args.output.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(args.output, **arrays)
    print(f"{args.output}: {len(arrays['label'])} clips, {len(arrays['positions'])} frames")


if __name__ == "__main__":
    main()
