"""Prints how well effects of actions are predicted, and what that takes: `python -m benchmarks.affordances`.

`--trials FILE` measures trials of your own, `--data DIR` the published ones; Table 6, times, and the robot's
own exploration need neither. Accuracy is per axis, averaged over both; splits are by trial. Times are CPU
seconds of one thread.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cognitive_arch.affordances import search
from cognitive_arch.affordances.compiled import CompiledEffects
from cognitive_arch.affordances.evaluation import Evaluation, evaluate, without_start
from cognitive_arch.affordances.explored import read_explored
from cognitive_arch.affordances.metrics import reliability, scores
from cognitive_arch.affordances.model import marginals_of
from cognitive_arch.affordances.network import DiscreteNetwork
from cognitive_arch.affordances.published import read_published
from cognitive_arch.affordances.queries import Lookup, Oracle
from cognitive_arch.affordances.registry import Affordances, model_class
from cognitive_arch.affordances.structures import ACTION, EFFECTS, fully_connected, named_structure
from cognitive_arch.affordances.transfer import transfer_curve
from cognitive_arch.affordances.trials import (
    ACTIONS,
    Names,
    TrialTable,
    action_index,
    from_frame,
    read_trials,
)

TABLE6: Mapping[str, int] = {"full": 21_257_680, "pca": 168, "fig40-bde": 1594, "fig40-k2": 535}
MODELS = ("default", "full", "pca", "pca-two-blocks", "k2", "bde", "bde-annealed", "mcmc")
PCA = ("pca", "pca-two-blocks")
BESIDE = ("majority", "forest", "logistic")
TARGETS: Mapping[tuple[str, bool, str], float] = {
    ("hand", False, "trial"): 0.73,
    ("hand", True, "trial"): 0.73,
    ("tool", False, "trial"): 0.58,
    ("tool", True, "trial"): 0.59,
    ("icub_tools", False, "trial"): 0.57,
    ("icub_tools", True, "trial"): 0.585,
    ("icub_tools", False, "leave-one-object-out"): 0.555,
    ("icub_tools", True, "leave-one-object-out"): 0.565,
}
"""(table, start known, protocol) -> accuracy the default model is to reach."""
ROWS = 28_000
NODES = 13


def row(what: str, measured: str, budget: str = "") -> None:
    """One line."""
    print(f"{what:<52} {measured:>20}   {budget}".rstrip(), flush=True)


def cpu(work: Callable[[], object], repeats: int = 1) -> float:
    """CPU seconds of one call."""
    started = time.process_time()
    for _ in range(repeats):
        work()
    return (time.process_time() - started) / repeats


def table6() -> None:
    """Complexity, exactly."""
    for name, published in TABLE6.items():
        row(f"Table 6: {name}", f"{named_structure(name).complexity:,}", f"{published:,}")


def times() -> None:
    """Structure search, learning and questions, on made-up data of a fixed size."""
    rng = np.random.default_rng(0)
    features = [f"d{i}" for i in range(NODES - 3)]
    structure = fully_connected(features)
    states = dict(structure.states)
    data = np.column_stack([rng.integers(0, size, ROWS) for size in states.values()])
    data[:, -2] = (data[:, 0] + data[:, 1] + (rng.random(ROWS) < 0.3)) % 5
    data[:, -1] = (data[:, 0] * data[:, 2] + (rng.random(ROWS) < 0.3)) % 5
    limits = search.Limits.effects_last(list(states), EFFECTS)
    searches: Mapping[str, Callable[[], object]] = {
        "K2": lambda: search.k2(search.LocalScores(data, states, "k2"), list(states), limits),
        "BDe, greedy": lambda: search.greedy(search.LocalScores(data, states), limits),
        "BDe, annealed": lambda: search.annealed(
            search.LocalScores(data, states), np.random.default_rng(0), limits
        ),
        "Markov chain": lambda: search.mcmc(
            search.LocalScores(data, states), np.random.default_rng(0), limits
        ),
    }
    for name, work in searches.items():
        row(f"structure by {name}, {ROWS} x {NODES}", f"{cpu(work):.2f} s", "< 10 s")
    network = DiscreteNetwork.fit(
        search.k2(search.LocalScores(data, states, "k2"), list(states), limits), data
    )
    compiled = CompiledEffects.of(network, (ACTION, *features))
    took = cpu(lambda: compiled(data[7, :-2]), 20_000)
    row("p(EffectX, EffectY | A, M, O), network", f"{took * 1e6:.1f} us", "< 50 us")


def made_up(count: int) -> TrialTable:
    """Trials by a formula, only to take times with."""
    import pandas as pd

    rng = np.random.default_rng(0)
    m, o = rng.random((12, 12)), rng.random((12, 12))
    columns: dict[str, object] = {"action": [ACTIONS[i % 4] for i in range(count)]}
    which_m, which_o = rng.integers(12, size=(2, count))
    columns |= {f"m_d{i}": m[which_m, i] + rng.normal(0, 0.02, count) for i in range(12)}
    columns |= {f"o_d{i}": o[which_o, i] + rng.normal(0, 0.02, count) for i in range(12)}
    columns |= {"manipulator": [f"m{i}" for i in which_m], "object": [f"o{i}" for i in which_o]}
    x0, y0 = rng.uniform(-0.6, -0.3, count), rng.uniform(-0.2, 0.2, count)
    far = 0.1 * m[which_m, 0] * rng.normal(1, 0.3, count)
    return from_frame(
        pd.DataFrame({**columns, "x0": x0, "y0": y0, "x1": x0 + far, "y1": y0 - far * o[which_o, 1]}),
        "made up",
    )


def learning(table: TrialTable) -> None:
    """Time to learn the default model from 3,353 trials, and to ask it."""
    found: list[Affordances] = []
    took = cpu(lambda: found.append(Affordances.learn(table, "default", np.random.default_rng(0))))
    row(f"learning the default model, {len(table)} trials", f"{took:.2f} s", "< 5 s")
    oracle = Oracle(found[0])
    m = [oracle.manipulator(name) for name in sorted(found[0].things_m)][:4]
    o = [oracle.object(name) for name in sorted(found[0].things_o)][:6]
    took = cpu(lambda: oracle.predict("pull", m[0], o[0], (-0.45, 0.0)), 10)
    row("a question to the default model", f"{took * 1e3:.1f} ms")
    lookups: list[Lookup] = []
    area = ((-0.7, -0.35), (-0.25, 0.35))
    took = cpu(lambda: lookups.append(Lookup.of(found[0], m, o, area)))
    row(f"compiling {len(m)} x {len(o)} things, 144 places", f"{took:.2f} s")
    took = cpu(lambda: lookups[0](2, 0, 0, (-0.45, 0.0)), 20_000)
    row("p(EffectX, EffectY | A, M, O, start), default", f"{took * 1e6:.1f} us", "< 50 us")


def accuracy(
    name: str, table: TrialTable, splits: int, models: Sequence[str], protocols: Sequence[str]
) -> None:
    """Every model by every protocol, with and without the place known."""
    for known in (False, True) if table.has_start else (False,):
        part = table if known else without_start(table)
        for protocol in protocols:
            print(f"\n{name}, {protocol}, start {'known' if known else 'not known'}")
            print(f"  {'':16}accuracy           distance log-lik.  Brier  calibr. 5x5 ll  random")
            for model in models:
                if known and model not in ("default", *BESIDE):
                    continue  # the networks have no node for it
                found = evaluate(part, model, protocol, splits, 0)
                target = TARGETS.get((name, known, protocol)) if model == "default" else None
                _line(found, f">= {target}" if target else "")


def _line(found: Evaluation, target: str) -> None:
    low, high = found.interval("accuracy")
    print(
        f"  {found.model:16}{found.mean('accuracy'):.3f} ({low:.3f}-{high:.3f})  {found.mean('distance'):.3f}"
        f"    {found.mean('log_likelihood'):.3f}   {found.mean('brier'):.3f}  "
        f"{scores(found.joint, found.bins).ece:.3f}   {found.mean('joint_log_likelihood'):.3f}  "
        f"{found.random:.2f}   {target}".rstrip(),
        flush=True,
    )


def pulling(name: str, table: TrialTable) -> None:
    """Predicted against observed success of pulling, per manipulator, on trials held out."""
    print(f"\n{name}: pulling, closer by more than 2.5 cm; held out by trial")
    order = np.random.default_rng(0).permutation(len(table)) % 5
    closer = np.zeros(len(table))
    for fold in range(5):
        fitted = model_class("default").fit(table.take(order != fold), np.random.default_rng(fold))
        test = order == fold
        closer[test] = marginals_of(fitted.joint(table.take(test)))[:, 0, 3:].sum(axis=1)
    pulls = table.action == action_index("pull")
    came = table.effect[:, 0] >= 0.025
    for manipulator in np.unique(table.manipulator):
        rows = pulls & (table.manipulator == manipulator)
        if rows.any():
            row(f"  {manipulator}", f"{closer[rows].mean():.2f}", f"observed {came[rows].mean():.2f}")
    error = reliability(closer[pulls], came[pulls]).error
    row("  expected calibration error", f"{error:.3f}", "< 0.05 (on our own exploration)")


def own_exploration(models: Sequence[str]) -> None:
    """The robot's own trials, in full: objects left out, and how often pulling works."""
    for name in ("explored", "explored-tool", "explored-hand"):
        table = read_explored(name)
        ahead(f"{name}, one object left out", table, models)
        ahead(f"{name}, one form in all its sizes left out", replace(table, object=forms(table)), models)
    pulling("the robot's own trials", read_explored())


def forms(table: TrialTable) -> Names:
    """What the objects are but for their size: Small-ball, Ball and Large-ball are balls, (n,)."""
    return np.array([name.split("-")[-1].lower() for name in table.object])


def ahead(what: str, table: TrialTable, models: Sequence[str]) -> None:
    """How far the default model is ahead of the others on objects it has not seen."""
    print(f"\n{what}")
    found = {model: evaluate(table, model, "leave-one-object-out", 0, 0) for model in models}
    for one in found.values():
        _line(one, "")
    for least, others in ((0.05, PCA), (0.0, (*BESIDE, *MODELS[1:]))):
        best = max((m for m in others if m in found), key=lambda model: found[model].mean("accuracy"))
        lead = found["default"].mean("accuracy") - found[best].mean("accuracy")
        verdict = "met" if lead >= least else "missed"
        row(f"  default ahead of {best}", f"{100 * lead:.1f} points", f">= {100 * least:.0f}: {verdict}")


def transfer(hands: TrialTable, tools: TrialTable, repetitions: int) -> None:
    """From hands to tools: accuracy against the number of trials with tools."""
    for model in ("default", "pca-two-blocks"):
        curve = transfer_curve(without_start(hands), without_start(tools), model, repetitions=repetitions)
        print(f"\nhands to tools, {model}: accuracy with so many trials with tools")
        print("  " + " " * 18 + "".join(f"{count:>8}" for count in curve.counts))
        for name, values in curve.accuracy.items():
            print(f"  {name:18}" + "".join(f"{v:8.3f}" for v in _means(values)), flush=True)


def _means(values: np.ndarray) -> list[float]:
    return [float(line.mean()) for line in values]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Measure what was learned about things.")
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder with the published trials")
    parser.add_argument("--trials", type=Path, metavar="FILE", help="trials of your own")
    parser.add_argument("--splits", type=int, default=20)
    parser.add_argument("--quick", action="store_true", help="only the default model, PCA, and baselines")
    options = parser.parse_args()
    models = (*(MODELS[:1] if options.quick else MODELS), *BESIDE)
    own = (*(("default", *PCA) if options.quick else MODELS), *BESIDE)
    row("what", "measured", "budget, published or target")
    table6()
    times()
    learning(made_up(3353))
    own_exploration(own)
    tables: dict[str, TrialTable] = {}
    if options.data:
        tables |= {name: read_published(options.data, name) for name in ("hand", "tool", "icub_tools")}
    if options.trials:
        tables[options.trials.stem] = read_trials(options.trials)
    for name, table in tables.items():
        enough = len(np.unique(table.object)) > 2
        protocols = ("trial", "leave-one-object-out") if enough else ("trial",)
        accuracy(name, table, options.splits, models, protocols)
        pulling(name, table)
    if options.data:
        transfer(tables["hand"], tables["tool"], max(1, options.splits // 4))


if __name__ == "__main__":
    main()
