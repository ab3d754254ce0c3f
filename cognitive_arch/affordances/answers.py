"""What `cogarch learn networks` and `cogarch query` do, and how they tell it: plain data and text."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cognitive_arch.affordances.evaluation import Evaluation, evaluate
from cognitive_arch.affordances.explored import EXPLORED, read_explored
from cognitive_arch.affordances.metrics import confidences, reliability
from cognitive_arch.affordances.model import marginals_of
from cognitive_arch.affordances.networks import NetworkModel
from cognitive_arch.affordances.published import READERS, read_published
from cognitive_arch.affordances.queries import Oracle, Place, Thing, goal_mask, matrix_text
from cognitive_arch.affordances.registry import BASELINES, MODELS, Affordances, check_place
from cognitive_arch.affordances.sight import HALVES, check_formulas, is_picture, seen_thing
from cognitive_arch.affordances.trials import ACTIONS, BINS, Floats, TrialTable, read_trials
from cognitive_arch.errors import AffordanceError, one_line, unknown

Notice = Callable[[str], None]


def load_table(trials: str, data: Path | None) -> TrialTable:
    """A file of trials, the robot's own exploration by name, or a published table by name when `data` says
    where these lie."""
    if trials in EXPLORED and not Path(trials).is_file():
        return read_explored(trials)
    if data is not None and not Path(trials).is_file():
        return read_published(data, trials)
    if trials in READERS and not Path(trials).is_file():
        raise AffordanceError(f"'{trials}' is a published table: say with --data where these lie")
    return read_trials(trials)


DRAWN = 4  # distributions in one picture
ALIKE = 1e-9  # of probability
GRAPHS = (".png", ".svg", ".dot", ".bif")


@dataclass(frozen=True)
class Study:
    """How to evaluate: `splits` 0 for not at all; a reliability diagram goes to `figure`."""

    protocol: str = "trial"
    splits: int = 0
    figure: Path | None = None
    beside: tuple[str, ...] = BASELINES


def learn(
    table: TrialTable,
    model: str,
    out: Path | None,
    graph: Path | None,
    study: Study,
    seed: int,
    notice: Notice,
) -> dict[str, Any]:
    """Learn a model, save it and its graph, and measure it beside the baselines."""
    if model in BASELINES and out is not None and model != "majority":
        valid = [name for name in MODELS if name not in ("forest", "logistic")]
        raise AffordanceError(f"'{model}' is for comparison and cannot be saved; valid: {', '.join(valid)}")
    if seed < 0:
        raise AffordanceError(f"seed {seed}; valid: 0 or more")
    if out is not None:
        check_place(out)
    if graph is not None:
        _check_graph(model, graph)
    started = time.perf_counter()
    learned = Affordances.learn(table, model, np.random.default_rng(seed))
    seconds = time.perf_counter() - started
    answer: dict[str, Any] = {
        "model": model,
        "source": table.source,
        "trials": learned.trials,
        "rows": len(table),
        "manipulators": sorted(learned.things_m),
        "objects": sorted(learned.things_o),
        "descriptors": {"manipulator": list(table.names_m), "object": list(table.names_o)},
        "start_known": table.has_start,
        "seconds": round(seconds, 3),
        "seed": seed,
        "files": [],
    }
    if out is not None:
        learned.save(out)
        answer["files"].append(str(out))
    if graph is not None:
        answer["files"].append(str(_graph(learned, graph)))
    if isinstance(learned.model, NetworkModel):
        structure = learned.model.networks[0].structure
        answer["edges"] = [list(edge) for edge in structure.edges]
        answer["complexity"] = structure.complexity
    if study.splits:
        answer["protocol"] = study.protocol
        found = _evaluations(table, model, study, seed, notice)
        answer["evaluation"] = [one.to_json() for one in found]
        if study.figure is not None:
            answer["files"].append(str(_reliability(found, study.figure)))
    return answer


def _evaluations(table: TrialTable, model: str, study: Study, seed: int, notice: Notice) -> list[Evaluation]:
    found = []
    for name in dict.fromkeys((model, *study.beside)):
        notice(f"evaluating {name}")
        found.append(evaluate(table, name, study.protocol, study.splits, seed))
    return found


def _reliability(found: Sequence[Evaluation], path: Path) -> Path:
    """How often the predicted bin came about, against how sure the model was."""
    from cognitive_arch.affordances.figures import reliability_picture

    return reliability_picture(
        {one.model: reliability(*confidences(marginals_of(one.joint), one.bins)) for one in found}, path
    )


def _check_graph(model: str, path: Path) -> None:
    """Before anything is learned."""
    networks = [name for name, kind in MODELS.items() if issubclass(kind, NetworkModel)]
    if model in MODELS and model not in networks:
        raise AffordanceError(f"'{model}' is no graph; valid: {', '.join(networks)}")
    if path.suffix not in GRAPHS:
        raise AffordanceError(f"'{one_line(path.name)}' is no graph; valid: {', '.join(GRAPHS)}")


def _graph(learned: Affordances, path: Path) -> Path:
    """The graph (.png, .svg, .dot), or the network itself for other programs (.bif)."""
    from cognitive_arch.affordances.figures import graph_picture

    assert isinstance(learned.model, NetworkModel)  # see `_check_graph`
    network = learned.model.networks[0]
    if path.suffix == ".bif":
        network.save(path)
        return path
    return graph_picture(network.structure, path, f"{learned.name}: {learned.trials} trials")


def learn_text(answer: Mapping[str, Any]) -> str:
    """The answer of `learn networks` for a terminal."""
    lines = [
        f"learned      {answer['model']} from {answer['trials']} trials of {answer['source']} "
        f"in {answer['seconds']:.1f} s",
        f"with         {', '.join(answer['manipulators'])}",
        f"on           {', '.join(answer['objects'])}",
    ]
    if "complexity" in answer:
        effects = [f"{a} -> {b}" for a, b in answer["edges"] if b.startswith("Effect")]
        lines.append(f"network      {answer['complexity']:,} parameters; {', '.join(effects) or 'no edges'}")
    if "evaluation" in answer:
        splits = answer["evaluation"][0]["splits"]
        lines += [
            "",
            f"protocol {answer['protocol']}, {splits} splits; accuracy with its 5th and 95th percentile",
        ]
        lines += _table(answer["evaluation"])
        lines += _verdict(answer["evaluation"])
    return "\n".join([*lines, *(f"wrote {path}" for path in answer["files"])])


def _table(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = [
        f"{'':16}{'accuracy':>9}{'':>16}{'distance':>10}{'log-lik.':>10}{'Brier':>8}{'calibr.':>9}"
        f"{'5x5 ll':>8}"
    ]
    for row in rows:
        low, high = row["intervals"]["accuracy"]
        lines.append(
            f"{row['model']:16}{row['accuracy']:9.3f}   ({low:.3f}-{high:.3f}){row['distance']:10.3f}"
            f"{row['log_likelihood']:10.3f}{row['brier']:8.3f}{row['pooled']['ece']:9.3f}"
            f"{row['joint_log_likelihood']:8.2f}"
        )
    return lines


def _verdict(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Whether the model is any better than guessing the most frequent effect of each action."""
    ours = rows[0]
    majority = next((row for row in rows if row["model"] == "majority"), None)
    if majority is None or ours is majority:
        return []
    gain = ours["accuracy"] - majority["accuracy"]
    if gain > 0:
        return [f"{ours['model']} is {gain:+.3f} above the most frequent effect of each action"]
    return [f"{ours['model']} is NOT better than the most frequent effect of each action ({gain:+.3f})"]


@dataclass(frozen=True)
class Question:
    """What is given; None is left open. `tools` are candidates to choose from. Of a manipulator that is seen
    in a picture the `half` counts that will touch the object; `formulas` are those of its descriptors."""

    action: str | None = None
    manipulator: str | None = None
    object: str | None = None
    start: Place | None = None
    goal: str | None = None
    tools: tuple[str, ...] = ()
    half: str = "top"
    formulas: str = "shapeDescriptor"


def parse_place(text: str | None) -> Place | None:
    """`X,Y` in metres; None stays None. Raises `AffordanceError` for anything else."""
    if text is None:
        return None
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise AffordanceError(
            f"a place is X,Y in metres, such as -0.45,0.1, not '{one_line(text, 30)}'"
        ) from None
    if not np.isfinite([x, y]).all():
        raise AffordanceError(f"a place is two finite numbers, not '{one_line(text, 30)}'")
    return x, y


def ask(learned: Affordances, question: Question, picture: Path | None = None) -> dict[str, Any]:
    """Effects if nothing is wished for; else the best tool (with an action and no manipulator), or action."""
    oracle = Oracle(learned)
    if question.half not in HALVES:
        raise AffordanceError(unknown("half", question.half, HALVES))
    check_formulas(question.formulas)
    if question.tools and (question.goal is None or question.action is None or question.manipulator):
        raise AffordanceError(
            "tools to choose from are for a question such as --action pull --goal closer --tools Stick,Rake "
            "(without --manipulator)"
        )
    m = _manipulator(oracle, question, question.manipulator) if question.manipulator else None
    o = _object(oracle, question, question.object) if question.object else None
    if question.action is not None and question.action not in (*ACTIONS, "draw"):
        raise AffordanceError(unknown("action", question.action, ACTIONS))
    answer: dict[str, Any] = {
        "asked": {
            "action": question.action,
            "manipulator": m.name if m else None,
            "object": o.name if o else None,
            "start": list(question.start) if question.start else None,
            "goal": question.goal,
        },
        "start_counts": bool(question.start and learned.model.counts(np.array([question.start]))[0]),
        "model": learned.name,
        "trials": learned.trials,
        "descriptors": {"manipulator": list(learned.names_m), "object": list(learned.names_o)},
    }
    cases: dict[str, Floats] = {}
    if question.goal is None:
        joint = oracle.predict(question.action, m, o, question.start)
        answer |= {"kind": "effects", "bins": list(BINS), "effects": joint.tolist()}
        cases[_title(question, m, o)] = joint
    else:
        cases = _choose(oracle, question, m, o, answer)
    if picture is not None:
        from cognitive_arch.affordances.figures import effects_picture

        answer["files"] = [str(effects_picture(dict(list(cases.items())[:DRAWN]), picture))]
        answer["drawn"] = list(cases)[:DRAWN]
    asked = [question.action] if question.action else list(ACTIONS)
    answer["never_tried"] = [action for action in asked if action not in learned.tried]
    return answer


def _manipulator(oracle: Oracle, question: Question, text: str) -> Thing:
    if is_picture(text):
        return seen_thing(text, question.half, oracle.learned.names_m, question.formulas)
    return oracle.manipulator(text)


def _object(oracle: Oracle, question: Question, text: str) -> Thing:
    if is_picture(text):
        return seen_thing(text, "whole", oracle.learned.names_o, question.formulas)
    return oracle.object(text)


def _choose(
    oracle: Oracle, question: Question, m: Thing | None, o: Thing | None, answer: dict[str, Any]
) -> dict[str, Floats]:
    """Put the choice into `answer`; returns the distributions behind it."""
    assert question.goal is not None
    goal, start = goal_mask(question.goal), question.start
    if question.action is not None and m is None:
        names = question.tools or tuple(oracle.learned.things_m)
        tools = [_manipulator(oracle, question, name) for name in names]
        ranked = oracle.select_tool(goal, question.action, tools, o, start)
        things = {t.name: t for t in tools}
        cases = {
            f"{question.action} with {name}": oracle.predict(question.action, things[name], o, start)
            for name in ranked
        }
        answer["kind"] = "tool"
    else:
        ranked = oracle.select_action(goal, m, o, start)
        # What was never tried is told last, and chosen only where there is nothing else.
        ranked = dict(sorted(ranked.items(), key=lambda item: item[0] not in oracle.learned.tried))
        if question.action is not None:
            ranked = {question.action: ranked[question.action]}
        cases = {_title(question, m, o, a): oracle.predict(a, m, o, start) for a in ranked}
        answer["kind"] = "action"
    answer["choice"] = next(iter(ranked))
    answer["ranking"] = [{"name": name, "probability": p, "posterior": q} for name, (p, q) in ranked.items()]
    return cases


def _title(question: Question, m: Thing | None, o: Thing | None, action: str | None = None) -> str:
    parts = [action or question.action or "any action", f"with {m.name}" if m else "with anything"]
    return " ".join([*parts, f"on {o.name}" if o else "on anything"])


def ask_text(answer: Mapping[str, Any]) -> str:
    """The answer of `query` for a terminal."""
    asked = answer["asked"]
    given = ", ".join(f"{k} {v}" for k, v in asked.items() if v is not None) or "nothing given"
    described = {len(names) for names in answer["descriptors"].values()}
    counted = " and ".join(str(number) for number in sorted(described))
    lines = [f"{answer['model']}, {answer['trials']} trials, {counted} descriptors; {given}"]
    if asked["start"] and not answer["start_counts"]:
        lines.append("start        not looked at: far from where things were tried, or not in the model")
    if answer["never_tried"]:
        lines.append(f"never tried  {', '.join(answer['never_tried'])}: the other actions' effects stand in")
    if answer["kind"] == "effects":
        lines.append(matrix_text(np.array(answer["effects"])))
    else:
        for row in answer["ranking"]:
            lines.append(f"  {row['name']:24} p({asked['goal']}) = {row['probability']:.3f}")
        tried = [row for row in answer["ranking"] if row["name"] not in answer["never_tried"]]
        lines.append(f"best         {_best(tried or answer['ranking'])}")
    if "drawn" in answer and len(answer["drawn"]) < len(answer.get("ranking", ())):
        lines.append(f"drawn        the first {len(answer['drawn'])} of {len(answer['ranking'])}")
    return "\n".join([*lines, *(f"wrote {path}" for path in answer.get("files", []))])


def _best(ranking: Sequence[Mapping[str, Any]]) -> str:
    """The likeliest, or how many of them are as likely."""
    top = ranking[0]["probability"]
    alike = [row["name"] for row in ranking if top - row["probability"] < ALIKE]
    if 1 < len(alike) == len(ranking):
        return "none of them: all are as likely"
    return " or ".join(alike) + (", which are as likely" if len(alike) > 1 else "")
