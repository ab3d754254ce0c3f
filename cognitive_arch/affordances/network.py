"""Discrete Bayesian networks: parameters, expectation-maximisation, online updates, inference, files."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from cognitive_arch.affordances.structures import Structure
from cognitive_arch.affordances.tables import ConditionalTable
from cognitive_arch.affordances.trials import Floats, Ints
from cognitive_arch.errors import AffordanceError, one_line, unknown

MAX_DENSE = 5_000_000
MAX_COMPLETIONS = 3_000_000
FORMAT = "cogarch-network-1"
PRIOR = 0.5
"""Pseudo-counts of every entry (the Dirichlet parameter minus 1)."""


@contextmanager
def _quietly() -> Iterator[None]:
    """pgmpy warns of its own deprecated modules when it is imported."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        yield


@dataclass
class DiscreteNetwork:
    """A structure and one table per node. Data have one column per node, in the structure's order of
    nodes, and hold states from 0 on; -1 stands for a missing value."""

    structure: Structure
    tables: dict[str, ConditionalTable]

    @classmethod
    def empty(cls, structure: Structure, prior: float = PRIOR) -> DiscreteNetwork:
        """A network that has seen nothing: every distribution is uniform."""
        states = structure.states
        return cls(
            structure,
            {
                node: ConditionalTable.empty(
                    states[node], tuple(states[p] for p in structure.of(node)), prior
                )
                for node in states
            },
        )

    @classmethod
    def fit(
        cls, structure: Structure, data: Ints, prior: float = PRIOR, weights: Floats | None = None
    ) -> DiscreteNetwork:
        """Maximum a posteriori parameters from complete data (n, nodes)."""
        network = cls.empty(structure, prior)
        network.update(data, weights)
        return network

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.structure.states)

    def _columns(self, node: str) -> tuple[int, list[int]]:
        place = {name: i for i, name in enumerate(self.nodes)}
        return place[node], [place[p] for p in self.structure.of(node)]

    def update(self, data: Ints, weights: Floats | None = None) -> None:
        """Count further trials (n, nodes), or a single one (nodes,)."""
        data = np.atleast_2d(np.asarray(data, dtype=np.int64))
        self._check(data, missing=False)
        for node, table in self.tables.items():
            column, parents = self._columns(node)
            table.add(data[:, column], data[:, parents], weights)

    def _check(self, data: Ints, missing: bool) -> None:
        if data.shape[1] != len(self.nodes):
            raise AffordanceError(
                f"{data.shape[1]} values for {len(self.nodes)} nodes: {', '.join(self.nodes)}"
            )
        lowest = -1 if missing else 0
        for column, (node, states) in enumerate(self.structure.states.items()):
            values = data[:, column]
            if len(values) and (values.min() < lowest or values.max() >= states):
                bad = values[(values < lowest) | (values >= states)][0]
                raise AffordanceError(f"node {node} has no state {bad}; valid: 0 to {states - 1}")

    def log_joint(self, data: Ints) -> Floats:
        """log p of each complete row, (n,)."""
        total = np.zeros(len(data))
        for node, table in self.tables.items():
            column, parents = self._columns(node)
            rows = table.rows(data[:, parents])
            total += np.log(table.probabilities[rows, data[:, column]])
        return total

    def pgmpy(self) -> Any:
        """The same network as pgmpy's."""
        with _quietly():
            from pgmpy.factors.discrete import TabularCPD
            from pgmpy.models import DiscreteBayesianNetwork

        if self.structure.complexity > MAX_DENSE:
            raise AffordanceError(
                f"a network of {self.structure.complexity:,} parameters has no dense form; "
                f"valid: up to {MAX_DENSE:,} (save it as .json)"
            )
        network = DiscreteBayesianNetwork()
        network.add_nodes_from(self.nodes)
        network.add_edges_from(self.structure.edges)
        for node, table in self.tables.items():
            parents = self.structure.of(node)
            states = {n: [f"s{i}" for i in range(self.structure.states[n])] for n in (node, *parents)}
            network.add_cpds(
                TabularCPD(
                    node,
                    table.states,
                    table.dense(),
                    evidence=list(parents) or None,
                    evidence_card=list(table.sizes) or None,
                    state_names=states,
                )
            )
        return network

    def infer(self, targets: Sequence[str], evidence: Mapping[str, int]) -> Floats:
        """p(targets | evidence), exactly, with one axis per target; whatever else there is, is summed out."""
        with _quietly():
            from pgmpy.inference import VariableElimination

        for node in (*targets, *evidence):
            if node not in self.structure.states:
                raise AffordanceError(unknown("node", node, self.nodes))
        for node, state in evidence.items():
            if not 0 <= state < self.structure.states[node]:
                raise AffordanceError(
                    f"node {node} has no state {state}; valid: 0 to {self.structure.states[node] - 1}"
                )
        both = sorted(set(targets) & set(evidence))
        if both or not targets:
            raise AffordanceError(f"{both[0]} is asked for and given" if both else "a question needs a node")
        factor = VariableElimination(self.pgmpy()).query(
            list(targets), {n: f"s{s}" for n, s in evidence.items()}, show_progress=False
        )
        order = [list(factor.variables).index(t) for t in targets]
        answer: Floats = np.transpose(np.asarray(factor.values, dtype=np.float64), order)
        return answer

    def to_json(self) -> dict[str, Any]:
        """Everything, as plain data."""
        return {
            "format": FORMAT,
            "states": dict(self.structure.states),
            "parents": {n: list(self.structure.of(n)) for n in self.nodes if self.structure.of(n)},
            "tables": {n: t.to_json() for n, t in self.tables.items()},
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> DiscreteNetwork:
        """The network `to_json` described; raises `AffordanceError` for anything else."""
        try:
            states = {str(n): int(s) for n, s in data["states"].items()}
            parents = {str(n): tuple(map(str, p)) for n, p in data["parents"].items()}
            structure = Structure(states, parents)
            tables = {
                n: ConditionalTable.from_json(
                    states[n], tuple(states[p] for p in structure.of(n)), data["tables"][n]
                )
                for n in states
            }
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise AffordanceError(f"this is no network: {one_line(error)}") from None
        return cls(structure, tables)

    def save(self, path: Path | str) -> None:
        """Write as .json (everything) or .bif (probabilities only, for other programs)."""
        path = Path(path)
        if path.suffix == ".json":
            path.write_text(json.dumps(self.to_json()) + "\n", encoding="utf-8")
        elif path.suffix == ".bif":
            with _quietly():
                from pgmpy.readwrite import BIFWriter

            BIFWriter(self.pgmpy()).write(filename=str(path))
        else:
            raise AffordanceError(f"'{one_line(path.name)}' is no network file; valid: .json, .bif")

    @classmethod
    def load(cls, path: Path | str) -> DiscreteNetwork:
        """Read .json or .bif. A .bif file has no counts: its probabilities stand for ESS pseudo-trials."""
        path = Path(path)
        if not path.is_file():
            raise AffordanceError(f"there is no network at '{one_line(path)}'")
        try:
            if path.suffix == ".json":
                return cls.from_json(json.loads(path.read_text(encoding="utf-8")))
            if path.suffix == ".bif":
                return _from_bif(path)
        except AffordanceError:
            raise
        except Exception as error:  # the parser of BIF raises whatever its grammar meets
            raise AffordanceError(f"cannot read '{one_line(path.name)}': {one_line(error, 120)}") from None
        raise AffordanceError(f"'{one_line(path.name)}' is no network file; valid: .json, .bif")


ESS = 1e6
"""Trials that each configuration of a network from a .bif file is taken to rest on."""


def _from_bif(path: Path) -> DiscreteNetwork:
    with _quietly():
        from pgmpy.readwrite import BIFReader

    read = BIFReader(str(path)).get_model()
    cpds = {str(cpd.variable): cpd for cpd in read.get_cpds()}
    if not cpds:
        raise AffordanceError(f"'{one_line(path.name)}' holds no network")
    states = {name: int(cpd.variable_card) for name, cpd in cpds.items()}
    parents = {name: tuple(str(v) for v in cpd.variables[1:]) for name, cpd in cpds.items()}
    network = DiscreteNetwork.empty(Structure(states, parents), prior=1e-9)
    for name, table in network.tables.items():
        probabilities = cpds[name].values.reshape(table.states, -1)
        configurations = probabilities.shape[1]
        table.keys = np.arange(configurations)
        table.counts = np.vstack([table.counts, ESS * probabilities.T])
    return network


def fit_missing(
    structure: Structure, data: Ints, prior: float = PRIOR, steps: int = 50, tolerance: float = 1e-6
) -> tuple[DiscreteNetwork, list[float]]:
    """Parameters by expectation-maximisation from data (n, nodes) with missing values (-1).

    Returns the network and log p(seen values, parameters) after each step, which never falls.
    """
    network = DiscreteNetwork.empty(structure, prior)
    network._check(data, missing=True)
    complete = (data >= 0).all(axis=1)
    rows, owner = _completions(structure, data)
    network.update(rows, np.zeros(len(rows)))  # every configuration that may come up has its prior
    # The first guess ignores incomplete rows; ties of a uniform start would never be broken.
    if complete.any():
        network.update(data[complete])
    history: list[float] = []
    for _ in range(steps):
        log_p = network.log_joint(rows)
        top = np.full(len(data), -np.inf)
        np.maximum.at(top, owner, log_p)
        weights = np.exp(log_p - top[owner])
        total = np.bincount(owner, weights, len(data))
        posterior = sum(_log_prior(table) for table in network.tables.values())
        history.append(float((np.log(total) + top).sum()) + posterior)
        network = DiscreteNetwork.fit(structure, rows, prior, weights / total[owner])
        if len(history) > 1 and history[-1] - history[-2] < tolerance * abs(history[-2]):
            break
    return network, history


def _log_prior(table: ConditionalTable) -> float:
    """log of the Dirichlet prior of all configurations seen, up to a constant."""
    return table.prior * float(np.log(table.probabilities[1:]).sum())


def _completions(structure: Structure, data: Ints) -> tuple[Ints, Ints]:
    """Every way to fill in each row, and which row it belongs to."""
    sizes = tuple(structure.states.values())
    ways = np.array([prod(s for s, v in zip(sizes, row, strict=True) if v < 0) for row in data])
    if ways.sum() > MAX_COMPLETIONS:
        raise AffordanceError(
            f"there are {int(ways.sum()):,} ways to fill in what is missing; valid: up to "
            f"{MAX_COMPLETIONS:,} (leave out descriptors that are hardly ever known)"
        )
    filled = []
    for row in data:
        rows = row[None]
        for column in np.flatnonzero(row < 0):
            rows = np.repeat(rows, sizes[column], axis=0)
            rows[:, column] = np.arange(len(rows)) % sizes[column]
        filled.append(rows)
    return np.concatenate(filled), np.repeat(np.arange(len(data)), ways)
