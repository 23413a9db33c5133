"""A folder of pictures to an adjusted scene with the covariance of its places, against bare pycolmap on the same pictures."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from comparison import Comparison, compare, table

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))

import scene_pictures as room  # noqa: E402

CAMERA = "f=600 ± 2 px"
FEATURES = 2000
TARGET = 1.1


def comparisons(turns: int = 3) -> list[Comparison]:
    """The same features, matching and mapping; ours reads and checks the pictures, adjusts once more, and has the covariance besides."""
    with tempfile.TemporaryDirectory() as folder:
        pictures = Path(folder) / "room"
        room.write(pictures)
        name = f"reconstruct, {len(room.TAKEN)} pictures of {room.WIDTH} x {room.HEIGHT}"
        return [
            compare(name, lambda: ours(pictures), "pycolmap, bare", lambda: bare(pictures), turns=turns, target=TARGET)
        ]


def ours(pictures: Path) -> int:
    """Pictures to a scene with its covariance."""
    from subtense.methods.reconstruction import Settings
    from subtense.workflow.reconstruct import pictures_in, reconstructed

    scene = reconstructed(pictures_in(pictures), camera=CAMERA, settings=Settings(most_features=FEATURES))
    return len(scene.points)


def bare(pictures: Path) -> int:
    """As the tutorials have it."""
    import pycolmap

    pycolmap.logging.minloglevel = 3
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model, reader.camera_params = "RADIAL", f"600,{room.WIDTH / 2},{room.HEIGHT / 2},0,0"
        options = pycolmap.FeatureExtractionOptions()
        options.sift.max_num_features = FEATURES
        pycolmap.extract_features(work / "db", pictures, camera_mode=pycolmap.CameraMode.SINGLE, reader_options=reader,
                                  extraction_options=options)  # fmt: skip
        pycolmap.match_exhaustive(work / "db")
        found = pycolmap.incremental_mapping(work / "db", pictures, work)
        return max((model.num_points3D() for model in found.values()), default=0)


def peak_mib(which: str, pictures: Path) -> float:
    """The most memory of one run in a process of its own, MiB."""
    code = (
        f"import sys; sys.path[:0] = {sys.path!r}\n"
        "import reconstruction, resource\nfrom pathlib import Path\n"
        f"reconstruction.{which}(Path({str(pictures)!r}))\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=Path(__file__).parent, capture_output=True, text=True, check=True
    )
    return float(done.stdout.split()[-1])


def main() -> None:
    """Times, and the most memory of each."""
    print(table(comparisons()))
    with tempfile.TemporaryDirectory() as folder:
        room.write(Path(folder) / "room")
        for which in ("ours", "bare"):
            print(f"{which}: {peak_mib(which, Path(folder) / 'room'):.0f} MiB at most")


if __name__ == "__main__":
    main()
