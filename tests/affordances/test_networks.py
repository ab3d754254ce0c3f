from __future__ import annotations

from itertools import product
from pathlib import Path

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.affordances import search
from cognitive_arch.affordances.compiled import CompiledEffects
from cognitive_arch.affordances.discretisation import Discretisation
from cognitive_arch.affordances.network import DiscreteNetwork, fit_missing
from cognitive_arch.affordances.pca import Components
from cognitive_arch.affordances.structures import NAMED, Structure, named_structure
from cognitive_arch.errors import AffordanceError

# Thesis Table 6.
TABLE6 = {"full": 21_257_680, "pca": 168, "fig40-bde": 1594, "fig40-k2": 535}


def sampled(structure: Structure, count: int, seed: int) -> np.ndarray:
    """States drawn from random tables, (count, nodes)."""
    tables, rng = np.random.default_rng(seed), np.random.default_rng([seed, count])
    names = list(structure.states)
    data = np.zeros((count, len(names)), dtype=np.int64)
    for node in structure.order():
        table = tables.dirichlet(np.full(structure.states[node], 0.4), structure.configurations(node))
        number = np.zeros(count, dtype=np.int64)
        for parent in structure.of(node):
            number = number * structure.states[parent] + data[:, names.index(parent)]
        cumulated = table.cumsum(axis=1)[number]
        data[:, names.index(node)] = (rng.random((count, 1)) > cumulated).sum(axis=1)
    return np.minimum(data, np.array(list(structure.states.values())) - 1)


CHAIN = Structure(
    {"Action": 4, "A": 3, "B": 3, "C": 2, "EffectX": 5, "EffectY": 5},
    {"B": ("A",), "EffectX": ("Action", "A"), "EffectY": ("Action", "EffectX", "B")},
)


@pytest.mark.parametrize("name", TABLE6)
def test_complexity_is_that_of_table_6(name: str) -> None:
    assert named_structure(name).complexity == TABLE6[name]


def test_named_structures_have_no_circles() -> None:
    for name in NAMED:
        assert len(named_structure(name).order()) == len(named_structure(name).states)
    with pytest.raises(AffordanceError, match="circle"):
        Structure({"a": 2, "b": 2}, {"a": ("b",), "b": ("a",)})
    with pytest.raises(AffordanceError, match="unknown structure 'fig41'"):
        named_structure("fig41")


def test_inference_agrees_with_summing_the_joint() -> None:
    network = DiscreteNetwork.fit(CHAIN, sampled(CHAIN, 300, 0))
    everything = np.array(list(product(*(range(s) for s in CHAIN.states.values()))))
    p = np.exp(network.log_joint(everything))
    assert p.sum() == pytest.approx(1.0)
    columns = list(CHAIN.states)
    given_rows = (everything[:, columns.index("EffectX")] == 2) & (everything[:, columns.index("B")] == 1)
    expected = np.bincount(everything[given_rows, 0], p[given_rows], 4) / p[given_rows].sum()
    np.testing.assert_allclose(network.infer(["Action"], {"EffectX": 2, "B": 1}), expected, atol=1e-9)


def test_compiled_questions_agree_with_exact_inference() -> None:
    network = DiscreteNetwork.fit(CHAIN, sampled(CHAIN, 200, 1))
    evidence = ("Action", "A", "B", "C")
    compiled = CompiledEffects.of(network, evidence)
    for states in product(range(4), range(3), range(3), range(2)):
        exact = network.infer(["EffectX", "EffectY"], dict(zip(evidence, states, strict=True)))
        np.testing.assert_allclose(compiled(np.array(states)), exact, atol=1e-9)
    many = compiled.many(np.array([[0, 0, 0, 0], [3, 2, 2, 1]]))
    np.testing.assert_array_equal(many[1], compiled(np.array([3, 2, 2, 1])))


def test_fully_connected_networks_keep_only_what_they_saw() -> None:
    names = [f"d{i}" for i in range(24)]
    states = {"Action": 4, **dict.fromkeys(names, 3), "EffectX": 5, "EffectY": 5}
    structure = Structure(states, dict.fromkeys(("EffectX", "EffectY"), ("Action", *names)))
    rng = np.random.default_rng(0)
    data = np.column_stack([rng.integers(0, size, 50) for size in states.values()])
    compiled = CompiledEffects.of(DiscreteNetwork.fit(structure, data), ["Action", *names])
    seen, never = data[0, :-2], 1 - np.minimum(data[0, :-2], 1)
    assert compiled(seen)[tuple(data[0, -2:])] == compiled(seen).max()
    np.testing.assert_allclose(compiled(never), 1 / 25)
    assert compiled.unseen(np.array([seen, never])).tolist() == [[False, False], [True, True]]


def test_updates_one_by_one_equal_learning_at_once() -> None:
    data = sampled(CHAIN, 60, 2)
    once = DiscreteNetwork.fit(CHAIN, data)
    grown = DiscreteNetwork.empty(CHAIN)
    for row in data:
        grown.update(row)
    np.testing.assert_allclose(grown.log_joint(data), once.log_joint(data))
    with pytest.raises(AffordanceError, match="node C has no state 2"):
        grown.update(np.array([0, 0, 0, 2, 0, 0]))


def test_em_never_loses_likelihood_and_beats_leaving_rows_out() -> None:
    data = sampled(CHAIN, 400, 3)
    holes = data.copy()
    mask = np.random.default_rng(0).random(data.shape) < 0.25
    mask[:, 0] = False
    holes[mask] = -1
    network, history = fit_missing(CHAIN, holes, steps=30)
    assert (np.diff(history) > -1e-6).all()
    fresh = sampled(CHAIN, 4000, 3)
    complete = DiscreteNetwork.fit(CHAIN, holes[(holes >= 0).all(axis=1)])
    assert network.log_joint(fresh).mean() > complete.log_joint(fresh).mean() + 0.05


@pytest.mark.parametrize("suffix", [".json", ".bif"])
def test_networks_survive_their_files(tmp_path: Path, suffix: str) -> None:
    data = sampled(CHAIN, 100, 4)
    network = DiscreteNetwork.fit(CHAIN, data)
    path = tmp_path / f"network{suffix}"
    network.save(path)
    again = DiscreteNetwork.load(path)
    assert set(again.structure.edges) == set(CHAIN.edges)
    order = [list(CHAIN.states).index(node) for node in again.nodes]
    np.testing.assert_allclose(again.log_joint(data[:, order]), network.log_joint(data), atol=1e-3)


@pytest.mark.parametrize(
    "text", ["", "{}", "[]", '{"states": {"a": 2}, "parents": {"a": ["b"]}, "tables": {}}', "network {"]
)
@pytest.mark.parametrize("suffix", [".json", ".bif", ".xml"])
def test_bad_network_files_are_refused(tmp_path: Path, text: str, suffix: str) -> None:
    path = tmp_path / f"bad{suffix}"
    path.write_text(text)
    with pytest.raises(AffordanceError) as caught:
        DiscreteNetwork.load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["k2", "bde"])
def test_local_scores_are_products_of_predictions(kind: str) -> None:
    """A marginal likelihood is what the model, as it learns, gives each trial in turn."""
    data = sampled(CHAIN, 150, 5)
    scores = search.LocalScores(data, CHAIN.states, kind, 10.0)
    columns = list(CHAIN.states)
    for node in CHAIN.states:
        parents = CHAIN.of(node)
        states, ways = CHAIN.states[node], CHAIN.configurations(node)
        prior = 1.0 if kind == "k2" else 10.0 / states / ways
        counts: dict[tuple[int, ...], np.ndarray] = {}
        expected = 0.0
        for row in data:
            seen = counts.setdefault(tuple(row[columns.index(p)] for p in parents), np.full(states, prior))
            value = row[columns.index(node)]
            expected += np.log(seen[value] / seen.sum())
            seen[value] += 1
        assert scores(node, frozenset(parents)) == pytest.approx(expected)


def test_bde_is_pgmpys() -> None:
    from pgmpy.structure_score import BDeu

    data = sampled(CHAIN, 200, 5)
    names = {node: list(range(states)) for node, states in CHAIN.states.items()}
    frame = pd.DataFrame(data, columns=list(names)).astype("category")
    theirs = BDeu(frame, equivalent_sample_size=10, state_names=names)
    ours = search.LocalScores(data, CHAIN.states, "bde", 10.0)
    for node, parents in (("B", ()), ("EffectX", ("A", "Action")), ("EffectY", ("A", "B", "EffectX"))):
        assert ours(node, frozenset(parents)) == pytest.approx(theirs.local_score(node, parents))


def test_searches_find_the_structure_that_made_the_data() -> None:
    data = sampled(CHAIN, 4000, 6)
    limits = search.Limits.effects_last(list(CHAIN.states), ["EffectX", "EffectY"])
    scores = search.LocalScores(data, CHAIN.states, "bde")

    def total(structure: Structure) -> float:
        return scores.total({n: frozenset(structure.of(n)) for n in structure.states})

    climbed = search.greedy(scores, limits)
    cooled = search.annealed(scores, np.random.default_rng(0), limits, steps=1500)
    assert total(Structure(CHAIN.states, {})) < total(climbed) <= total(cooled)
    assert total(cooled) >= total(CHAIN) - 1e-6
    assert set(cooled.of("EffectY")) == {"Action", "EffectX", "B"}
    by_order = search.k2(search.LocalScores(data, CHAIN.states, "k2"), list(CHAIN.states), limits)
    assert by_order.of("EffectX") == ("Action", "A")
    assert not [edge for edge in cooled.edges if edge in limits.forbidden]


def test_annealing_finds_what_no_single_edge_shows() -> None:
    """Neither parent of an exclusive or tells anything without the other."""
    rng = np.random.default_rng(0)
    bits = rng.integers(0, 2, (300, 2))
    data = np.column_stack([bits, bits[:, 0] ^ bits[:, 1] ^ (rng.random(300) < 0.05)])
    scores = search.LocalScores(data, {"a": 2, "b": 2, "xor": 2}, "bde")
    assert not search.greedy(scores).edges
    assert len(search.annealed(scores, np.random.default_rng(0)).edges) >= 2


def test_the_chain_visits_structures_as_often_as_they_are_probable() -> None:
    small = Structure({"a": 2, "b": 2, "c": 2}, {"b": ("a",)})
    data = sampled(small, 25, 7)
    scores = search.LocalScores(data, small.states, "bde")
    weights: dict[tuple[tuple[str, str], ...], float] = {}
    arcs = list(product("abc", "abc"))
    for picked in product([0, 1], repeat=9):
        edges = [arc for arc, on in zip(arcs, picked, strict=True) if on]
        graph = nx.DiGraph(edges)
        if nx.is_directed_acyclic_graph(graph):
            parents = {n: frozenset(p for p, c in edges if c == n) for n in "abc"}
            weights[tuple(sorted(edges))] = np.exp(scores.total(parents))
    total = sum(weights.values())
    expected = sum(w for edges, w in weights.items() if ("a", "b") in edges) / total
    chain = search.mcmc(scores, np.random.default_rng(0), steps=20_000, burn_in=500)
    assert len(weights) == 25
    assert chain.edges["a", "b"] == pytest.approx(expected, abs=0.03)


@settings(max_examples=50)
@given(st.lists(st.floats(-5, 5), min_size=6, max_size=40), st.integers(2, 3))
def test_levels_are_ordered_and_stay_in_range(values: list[float], levels: int) -> None:
    column = np.array(values)[:, None]
    found = Discretisation.fit(column, levels)
    states = found(column)[:, 0]
    assert set(states) <= set(range(levels))
    assert (np.diff(states[np.argsort(column[:, 0], kind="stable")]) >= 0).all()
    assert found(np.array([[-9.0], [9.0], [np.nan]]))[:, 0].tolist() in ([0, levels - 1, -1],)


def test_equal_shares_where_there_are_enough_values() -> None:
    values = np.random.default_rng(0).normal(size=(300, 1))
    assert np.bincount(Discretisation.fit(values, 3)(values)[:, 0]).tolist() == [100, 100, 100]


def test_components_explain_what_varies() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=(200, 1)) * np.array([[3.0, -4.0]]) + 0.01 * rng.normal(size=(200, 2))
    found = Components.fit(values, 1)
    assert found.share[0] > 0.999
    np.testing.assert_allclose(np.abs(found.axes[0]), [0.6, 0.8], atol=1e-3)
    assert found.axes[0, 1] > 0
