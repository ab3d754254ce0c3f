"""How well the robot knows its table by its eyes: `python -m benchmarks.sight [--scenes 200] [--jobs 2]`.

Random scenes of both domains, looked at as they lie, piled up, and with a thing in a hand
(`sim/sight_trials.py`): how far off things are, and how many atoms are right. With `--eyes
noise` the sensors have noise, with `--eyes shadows` things cast hard shadows, too. About six seconds a scene;
nothing here can fail a test.
"""

from __future__ import annotations

import argparse
import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

from sim.eyes import IDEAL, SENSOR
from sim.sight_trials import Look, looks

SCENES = 200
EYES = {  # noise of the sensors, and whether things cast shadows
    "ideal": (IDEAL, False),
    "noise": (SENSOR, False),
    "shadows": (SENSOR, True),
}
MOMENTS = ("lying", "piled", "in hand")


def seen(eyes: str, seed: int) -> list[Look]:
    """The looks at one scene, with one of `EYES`."""
    noise, shadows = EYES[eyes]
    return list(looks(seed, noise, shadows))


def rows(
    scenes: int = SCENES, jobs: int = 1, told: bool = False, eyes: str = "ideal"
) -> Iterator[tuple[str, str, str]]:
    """What was measured: what, how much, and the goal where there is one."""
    # Fresh processes: forked ones would share the state of Drake.
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        found = []
        for seed, those in enumerate(pool.map(partial(seen, eyes), range(scenes))):
            found += those
            if told:
                _tell(seed, those)
    millimetres = 1000 * np.array([error for look in found for error in look.errors.values()])
    n = f"{scenes} random scenes, {len(millimetres)} things"
    yield f"position on the table, median, {n}", f"{np.median(millimetres):.1f} mm", "5 mm"
    yield "position on the table, 95th percentile", f"{np.percentile(millimetres, 95):.1f} mm", "12 mm"
    yield "position on the table, worst", f"{millimetres.max():.1f} mm", ""
    for moment in (*MOMENTS, "all"):
        those = [look for look in found if moment in (look.moment, "all")]
        mistaken = sum(len(look.wrong) + len(look.overlooked) for look in those)
        atoms = sum(look.atoms for look in those)
        yield f"atoms right, {moment} ({len(those)} looks, {atoms} atoms)", _share(mistaken, atoms), ">= 99 %"
    strangers = sum(look.strangers for look in found)
    yield "seen and not known, where all there is is known", f"{strangers} things", ""
    for predicate in sorted({name for look in found for name in look.counts} - {"isHand"}):
        mistaken = sum(look.mistaken(predicate) for look in found)
        atoms = sum(look.counts.get(predicate, 0) for look in found)
        yield f"{predicate} right ({atoms} atoms)", _share(mistaken, atoms), ">= 99 %"


def _share(mistaken: int, atoms: int) -> str:
    return f"{100 * (1 - mistaken / max(1, atoms)):.2f} %"


def _tell(seed: int, those: Sequence[Look]) -> None:
    for look in those:
        if look.strangers:
            print(f"    scene {seed}, {look.moment}: {look.strangers} seen and not known", flush=True)
        if look.wrong or look.overlooked:
            wrong, overlooked = (", ".join(atoms) for atoms in (look.wrong, look.overlooked))
            print(
                f"    scene {seed}, {look.moment}: wrong {wrong or '-'}; overlooked {overlooked or '-'}",
                flush=True,
            )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, and before it what was mistaken where."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0] if __doc__ else None)
    parser.add_argument("--scenes", type=int, default=SCENES)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--eyes", choices=EYES, default="ideal")
    options = parser.parse_args(arguments)
    for what, measured, goal in rows(options.scenes, options.jobs, told=True, eyes=options.eyes):
        print(f"{what:<66} {measured:>12}   {goal}".rstrip(), flush=True)


if __name__ == "__main__":
    main()
