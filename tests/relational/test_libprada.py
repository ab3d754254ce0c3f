from __future__ import annotations

import itertools
import json
import os
import random
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.errors import RuleError
from cognitive_arch.relational.derived import in_order
from cognitive_arch.relational.libprada import LibPradaProblem, SymbolKind, load_problem, write_problem
from cognitive_arch.relational.rules import GroundOutcome, GroundRule, GroundRules, RuleSet
from cognitive_arch.relational.symbols import Atom, Goal, GroundAction, Literal, State
from cognitive_arch.relational.transition import covering_rule
from tests.conftest import action, literals, state

ROOT = Path(__file__).resolve().parents[2]
BLOCKS = ROOT / "tests/data/libprada/blocks"
SAMPLES = Path(os.environ.get("COGARCH_DATA", ROOT.parent / "shared/data")) / "libprada"
NAMES = ("symbols", "rules", "state", "goal")


def load(folder: Path) -> LibPradaProblem:
    return load_problem(*(folder / f"{name}.dat" for name in NAMES))


def write(folder: Path, **texts: str | bytes) -> Path:
    """The blocks problem with some of its files replaced."""
    for name in NAMES:
        text = texts.get(name, (BLOCKS / f"{name}.dat").read_bytes())
        (folder / f"{name}.dat").write_bytes(text.encode() if isinstance(text, str) else text)
    return folder


def rule(context: str = "on(X Y)", outcomes: str = "0.9 -on(X Y)\n0.1 <noise>", head: str = "grab(X)") -> str:
    return f"ACTION:\n{head}\nCONTEXT:\n{context}\nOUTCOMES:\n{outcomes}\n"


def ground_terms(problem: LibPradaProblem) -> tuple[State, Goal, tuple[GroundRule, ...]]:
    return problem.state, problem.goal, tuple(problem.rules)


# ------------------------------------------------------------------------------------ published samples


@pytest.mark.skipif(not SAMPLES.is_dir(), reason="the samples are not here; COGARCH_DATA names their folder")
def test_samples_load_and_round_trip(tmp_path: Path) -> None:
    folders = sorted(path.parent for path in SAMPLES.glob("*/*/rules.dat"))
    assert len(folders) == 8
    for folder in folders:
        meta = json.loads((folder / "meta.json").read_text(encoding="utf-8"))
        problem = load(folder)
        assert len(problem.rules) == meta["ground_rules"]
        assert len(problem.names(SymbolKind.ACTION)) == meta["action_symbols"]
        assert len(problem.names(SymbolKind.PRIMITIVE)) == meta["primitive_symbols"]
        assert problem.goal == literals_of(meta["goal"])
        assert (problem.constants, problem.rules.derived) == ((), ())
        write_problem(tmp_path, problem.rules, problem.state, problem.goal)
        assert ground_terms(load(tmp_path)) == ground_terms(problem)


def literals_of(text: str) -> Goal:
    words = text.split()
    return tuple(Literal(Atom(w.lstrip("-").removesuffix("()"), ()), not w.startswith("-")) for w in words)


@pytest.mark.skipif(not SAMPLES.is_dir(), reason="the samples are not here; COGARCH_DATA names their folder")
def test_a_sample_rule_in_full() -> None:
    first = load(SAMPLES / "simple/g1").rules[0]
    assert first.action == GroundAction("grasp_13_with_11", ())
    assert first.outcomes == (GroundOutcome(0.95, literals_of("13_inhand_11() -11_clearhand()")),)
    assert first.noise == pytest.approx(0.05)


# ------------------------------------------------------------------------------------ lifted rules


def test_blocks_are_grounded() -> None:
    problem = load(BLOCKS)
    assert problem.constants == ("60", "61", "62", "63")
    # grab(X): X is no table (3 choices), Y anything else (3). puton(X): X is one of 4, Y another block.
    counts = {
        name: sum(r.action.name == name for r in problem.rules) for name in ("grab", "puton", "default")
    }
    assert counts == {"grab": 9, "puton": 3 + 2 + 2 + 2, "default": 0}
    assert problem.goal == (*literals("above(63,61)", "clear(63)"), Literal(Atom("height=3", ("63",))))
    grab = next(r for r in problem.rules if r.action == action("grab(62)") and r.applies(problem.state))
    assert set(grab.context) == set(literals("not table(62)", "clear(62)", "inhandNil()", "on(62,61)"))
    assert grab.outcomes == (
        GroundOutcome(0.8, literals("inhand(62)", "not on(62,61)")),
        GroundOutcome(0.1, ()),
    )


def test_a_deictic_reference_picks_the_one_rule_that_covers() -> None:
    problem = load(BLOCKS)
    covering = covering_rule(problem.rules, action("grab(62)"), problem.state)
    assert covering is not None
    assert Literal(Atom("on", ("62", "61")), False) in covering.outcomes[0].literals
    # 61 is not clear, and so its rules do not apply, whatever it stands on.
    assert covering_rule(problem.rules, action("grab(61)"), problem.state) is None


def test_deictic_references_may_coincide_but_not_with_arguments(tmp_path: Path) -> None:
    rules = rule("on(Y X) on(Z X)", "1 -on(Y X) -on(Z X)")
    made = load(write(tmp_path, rules=rules)).rules
    assert len(made) == 4 * 3 * 3
    args = {(r.context[0].atom.args[0], r.context[-1].atom.args[0], r.action.args[0]) for r in made}
    assert all(y != x != z for y, z, x in args)
    assert sum(y == z for y, z, _ in args) == 4 * 3


def test_what_no_rule_changes_filters(tmp_path: Path) -> None:
    rules = rule("table(Y) on(X Y) -inhand(X)", "1 -on(X Y)")
    made = load(write(tmp_path, rules=rules)).rules
    assert {str(r.action) for r in made} == {"grab(61)", "grab(62)", "grab(63)"}
    assert {r.context[0] for r in made} == set(literals("table(60)"))


def test_contradicting_contexts_are_left_out(tmp_path: Path) -> None:
    # Y and Z differ wherever on(Y X) and -on(Z X) stand together.
    made = load(write(tmp_path, rules=rule("on(X Y) inhand(Z) -on(X Z)", "1 -on(X Y) -inhand(Z)"))).rules
    assert len(made) == 4 * 3 * 2


def test_digits_are_variables_and_names_are_constants(tmp_path: Path) -> None:
    text = "table(Table) on(Ham Table) on(Bun-top,Ham)"
    goal = "clear(Table)"
    problem = load(write(tmp_path, rules=rule("on(0 1)", "1 -on(0 1)", "grab(0)"), state=text, goal=goal))
    assert problem.constants == ("Bun-top", "Ham", "Table")
    assert len(problem.rules) == 6
    assert state("on(Ham,Table)", "on(Bun-top,Ham)") <= problem.state


def test_three_digits_are_rescaled_and_more_are_kept(tmp_path: Path) -> None:
    rounded = load(write(tmp_path, rules=rule("on(X Y)", "0.333 -on(X Y)\n0.333 <no-change>\n0.333 <noise>")))
    assert sum(o.probability for o in rounded.rules[0].outcomes) == pytest.approx(0.667, abs=1e-15)
    assert rounded.rules[0].noise == pytest.approx(0.333, abs=1e-15)
    exact = load(
        write(tmp_path, rules=rule("on(X Y)", "0.1234567890123456 -on(X Y)\n0.8765432109876544 <noise>"))
    )
    assert exact.rules[0].outcomes[0].probability == 0.1234567890123456


def test_thirty_entities_are_grounded(tmp_path: Path) -> None:
    symbols = "put 3 action binary\non 2 primitive binary\nhand 1 primitive binary\nheld 2 primitive binary\n"
    rules = rule("hand(Z) -hand(X) -hand(Y) held(X Z)", "0.9 on(X Y) -held(X Z)\n0.1 <noise>", "put(X Y Z)")
    facts = "hand(10) hand(11) " + " ".join(f"on({n} {n + 1})" for n in range(12, 39))
    folder = write(tmp_path, symbols=symbols, rules=rules, state=facts, goal="on(39 12)")
    assert len(load(folder).rules) == 28 * 27 * 2


# ------------------------------------------------------------------------------------ derived symbols


def brute_force(facts: State, constants: tuple[str, ...]) -> set[Atom]:
    on = {atom.args for atom in facts if atom.predicate == "on"}
    above = set(on)
    while new := {(x, w) for x, y in above for z, w in above if y == z} - above:
        above |= new
    clear = {c for c in constants if not any((y, c) in on for y in constants if y != c)}
    heights = {c: sum((c, y) in above for y in constants) for c in constants}
    return (
        {Atom("above", pair) for pair in above}
        | {Atom("clear", (c,)) for c in clear}
        | {Atom("height<3", (c,)) for c in constants if heights[c] < 3}
        | {Atom("height=3", (c,)) for c in constants if heights[c] == 3}
    )


@settings(max_examples=30, deadline=None)
@given(st.sets(st.sampled_from(list(itertools.product(("60", "61", "62", "63"), repeat=2)))))
def test_derived_symbols_against_brute_force(
    tmp_path_factory: pytest.TempPathFactory, pairs: set[tuple[str, str]]
) -> None:
    facts = "table(60) -inhand(61) -inhand(62) -inhand(63) " + " ".join(f"on({x} {y})" for x, y in pairs)
    problem = load(write(tmp_path_factory.mktemp("blocks"), state=facts))
    defined = {atom for definition in problem.rules.derived for atom in definition.defines}
    expected = brute_force(problem.state, problem.constants) | {Atom("inhandNil", ())}
    assert problem.state & defined == expected & defined
    assert set(in_order(problem.rules.derived)) == set(problem.rules.derived)
    needed = {lit.atom for r in problem.rules for lit in r.context if lit.atom in expected}
    assert needed <= defined


def test_existential_conjunctions_bind_distinct_others(tmp_path: Path) -> None:
    symbols = (BLOCKS / "symbols.dat").read_text(encoding="utf-8")
    symbols += (
        "crowded 1 conjunction binary <-- Ex Y Z on(Y X) on(Z X)\nplaced 1 conjunction binary <-- on(X Y)\n"
    )
    goal = "crowded(60) -crowded(61) placed(61) -placed(60)"
    problem = load(write(tmp_path, symbols=symbols, goal=goal))
    assert all(literal.holds(problem.state) for literal in problem.goal)
    assert state("crowded(60)", "placed(61)") <= problem.state


def test_only_what_is_needed_is_defined(tmp_path: Path) -> None:
    problem = load(write(tmp_path, rules=rule("on(X Y)"), goal="clear(60)"))
    assert [definition.defines for definition in problem.rules.derived] == [(Atom("clear", ("60",)),)]


# ------------------------------------------------------------------------------------ writing

ENTITIES = ("Bun-top", "Ham", "X")
ATOMS = st.builds(Atom, st.just("on"), st.tuples(*[st.sampled_from(ENTITIES)] * 2)) | st.builds(
    Atom, st.sampled_from(("isClear", "held")), st.tuples(st.sampled_from(ENTITIES))
)


def conjunctions(least: int) -> st.SearchStrategy[Goal]:
    signs = st.dictionaries(ATOMS, st.booleans(), min_size=least, max_size=4)
    return signs.map(lambda chosen: tuple(Literal(atom, sign) for atom, sign in chosen.items()))


@st.composite
def ground_rules(draw: st.DrawFn) -> GroundRule:
    weights = draw(st.lists(st.floats(0.001, 1), min_size=2, max_size=4))
    total = sum(weights) * 1.0000001
    outcomes = tuple(GroundOutcome(weight / total, draw(conjunctions(0))) for weight in weights[1:])
    name, args = draw(st.sampled_from([("grab", ("Ham",)), ("put", ("Ham", "X")), ("wait", ())]))
    return GroundRule(GroundAction(name, args), draw(conjunctions(0)), outcomes)


@settings(max_examples=60, deadline=None)
@given(st.lists(ground_rules(), min_size=1, max_size=4), st.frozensets(ATOMS), conjunctions(1))
def test_what_is_written_reads_back(
    tmp_path_factory: pytest.TempPathFactory, rules: list[GroundRule], facts: State, goal: Goal
) -> None:
    folder = tmp_path_factory.mktemp("round")
    numbers = write_problem(folder, rules, facts, goal)
    again = load(folder)
    back = {number: name for name, number in numbers.items()}

    def named(literal: Literal) -> Literal:
        return Literal(
            Atom(literal.atom.predicate, tuple(back[a] for a in literal.atom.args)), literal.positive
        )

    assert {named(Literal(atom)).atom for atom in again.state} == facts
    assert tuple(map(named, again.goal)) == goal
    assert [r.action for r in rules] == [
        GroundAction(r.action.name, tuple(back[a] for a in r.action.args)) for r in again.rules
    ]
    for one, other in zip(rules, again.rules, strict=True):
        assert tuple(map(named, other.context)) == one.context
        assert [(o.probability, tuple(map(named, o.literals))) for o in other.outcomes] == [
            (o.probability, o.literals) for o in one.outcomes
        ]


def test_native_rules_are_written_with_numbers(
    tmp_path: Path, ground: tuple[GroundRule, ...], start: State
) -> None:
    numbers = write_problem(tmp_path / "new", ground, start, literals("on(Ham,Bun-bottom)"))
    assert sorted(numbers.values()) == ["10", "11", "12", "13", "14"]
    header = (tmp_path / "new/symbols.dat").read_text(encoding="utf-8")
    assert f"# {numbers['Ham']} = Ham\n" in header
    again = load(tmp_path / "new")
    assert len(again.rules) == len(ground)
    assert {str(a) for a in again.state} == {renamed(str(a), numbers) for a in start}


def renamed(text: str, numbers: object) -> str:
    assert isinstance(numbers, dict)
    name, _, args = text.rstrip(")").partition("(")
    return f"{name}({','.join(numbers[a] for a in args.split(',') if a)})"


RULE = GroundRule(GroundAction("grab", ("Ham",)), (), (GroundOutcome(0.5, literals("held(Ham)")),))


@pytest.mark.parametrize(
    ("rules", "goal", "message"),
    [
        ((), literals("held(Ham)"), "no rule"),
        ((RULE,), (), "no goal"),
        ((RULE,), literals("held(Ham)", "not held(Ham)"), "contradicts itself"),
        ((RULE,), literals("Held(Ham)"), "cannot read the name 'Held'"),
        ((RULE,), literals("held(Ham,Ham)"), "different numbers of arguments"),
        ((RULE,), literals("grab(Ham)"), "both as predicate and as action"),
        ((RULE.with_first_probability(float("nan")),), literals("held(Ham)"), "sum of at most 1"),
        ((RULE.with_first_probability(1.2),), literals("held(Ham)"), "sum of at most 1"),
    ],
)
def test_what_cannot_be_written(
    tmp_path: Path, rules: tuple[GroundRule, ...], goal: Goal, message: str
) -> None:
    with pytest.raises(RuleError, match="valid: ") as raised:
        write_problem(tmp_path / "out", rules, frozenset(), goal)
    assert message in str(raised.value)
    assert not (tmp_path / "out").exists()


def test_derived_definitions_are_not_written(tmp_path: Path, rules: RuleSet) -> None:
    problem = load(BLOCKS)
    with pytest.raises(RuleError, match=r"derived predicates are not written.*above"):
        write_problem(tmp_path, problem.rules, problem.state, problem.goal)
    with pytest.raises(RuleError, match="cannot write to"):
        write_problem(BLOCKS / "goal.dat", GroundRules([RULE]), frozenset(), literals("held(Ham)"))


# ------------------------------------------------------------------------------------ malformed files

SYMBOLS = "grab 1 action binary\non 2 primitive binary\n"


@pytest.mark.parametrize(
    ("name", "text", "line", "message"),
    [
        ("symbols", "", 1, "there is nothing in this symbols file"),
        ("symbols", "# only this\n\n", 1, "there is nothing in this symbols file"),
        ("symbols", SYMBOLS + "on 2 primitive binary", 3, "on is declared twice; valid: once, as in line 2"),
        ("symbols", SYMBOLS + "size 1 primitive integers", 3, "size is declared as primitive with the range"),
        ("symbols", SYMBOLS + "size 1 primitive numbers", 3, "unknown range 'numbers'; valid: binary"),
        ("symbols", SYMBOLS + "size 1 avg reals <-- on", 3, "'avg' are not read; valid: action, primitive"),
        ("symbols", SYMBOLS + "Size 1 primitive binary", 3, "'Size' cannot be the name"),
        ("symbols", SYMBOLS + "size one primitive binary", 3, "the arity of size is 'one'"),
        ("symbols", SYMBOLS + "size 1 primitive", 3, "cannot read 'size 1 primitive'"),
        ("symbols", SYMBOLS + "[any]", 3, "argument types are not read"),
        ("symbols", SYMBOLS + "top 1 conjunction binary", 3, "needs a definition"),
        ("symbols", SYMBOLS + "top 1 conjunction binary <-- All Y", 3, "defined by no literal"),
        ("symbols", SYMBOLS + "top 1 conjunction binary <-- All Ex Y on(Y X)", 3, "two quantifiers"),
        (
            "symbols",
            SYMBOLS + "top 1 conjunction binary <-- onn(Y X)",
            3,
            "unknown symbol 'onn' (did you mean on?)",
        ),
        (
            "symbols",
            SYMBOLS + "top 1 conjunction binary <-- grab(X)",
            3,
            "which cannot stand in a definition",
        ),
        ("symbols", SYMBOLS + "top 1 conjunction binary <-- top(X)", 3, "follow from each other"),
        ("symbols", SYMBOLS + "over 2 transclosure binary <-- on", 3, "valid: + and a symbol of arity 2"),
        ("symbols", SYMBOLS + "over 2 transclosure binary <-- + grab", 3, "cannot be the closure of 'grab'"),
        ("symbols", SYMBOLS + "many 1 count integers <-- Num Y on(X Y) on(Y X)", 3, "many counts 2 literals"),
        ("symbols", SYMBOLS + "many 2 count integers <-- on(X Y)", 3, "no variable to count over"),
        ("symbols", SYMBOLS + "move 1 action binary <-- on(X Y)", 3, "has no definition"),
        ("rules", "", 1, "there is nothing in this rules file"),
        ("rules", "ACTION:\ngrab(X)\n", 2, "the file ends within a rule; valid: CONTEXT:"),
        ("rules", "ACTION:\ngrab(X)\nCONTEXT:\n--\n", 4, "the file ends within a rule; valid: OUTCOMES:"),
        ("rules", "ACTION:\ngrab(X)\nCONTEXT:\n--\nOUTCOMES:\n\n", 5, "the file ends within a rule"),
        ("rules", "ACTION:\ngrab(X)\nOUTCOMES:\n", 3, "cannot read 'OUTCOMES:'; valid: CONTEXT:"),
        ("rules", "ACTION:\ngrab(X)\nCONTEXT:\nOUTCOMES:\n", 4, "valid: literals, or -- for none"),
        ("rules", "ACTION:\ngrab(X) grab(Y)\nCONTEXT:\n", 2, "here are 2 actions"),
        ("rules", rule() + "noise\n", 8, "an outcome stands after <noise>"),
        ("rules", rule(head="on(X Y)"), 2, "on is declared as primitive, which cannot stand in an action"),
        ("rules", rule(head="-grab(X)"), 2, "an action cannot be negated"),
        ("rules", rule(context="grab(X)"), 4, "grab is declared as action, which cannot stand in a context"),
        ("rules", rule(context="on(X Y"), 4, "the parenthesis in 'on(X' is not closed"),
        ("rules", rule(context="on(X)"), 4, "on takes 2 arguments, here it has 1"),
        ("rules", rule(context="on(X Y), -on(Z X)"), 4, "the variable Z of on is never bound"),
        ("rules", rule(context="on(X ?)"), 4, "cannot read the argument '?'"),
        ("rules", rule(context="on(X 07)"), 4, "cannot read the argument '07'"),
        ("rules", rule(context="on(X Y)=2"), 4, "on is true or false and cannot be compared"),
        ("rules", rule(context="height(X)"), 4, "height is a count and must be compared"),
        ("rules", rule(context="height(X)=?"), 4, "height cannot be compared by '=?'"),
        ("rules", rule(context="height(X)+=1"), 4, "height cannot be compared by '+='"),
        ("rules", rule(context="height(X)=two"), 4, "height is compared with 'two'"),
        ("rules", rule(outcomes="1 inhand(V)"), 6, "the variable V of inhand is never bound"),
        ("rules", rule(outcomes="1 clear(X)"), 6, "clear is declared as conjunction, which cannot stand"),
        ("rules", rule(outcomes="1 inhand(X) -inhand(X)"), 6, "makes inhand both true and false"),
        ("rules", rule(outcomes="1 inhand(X) [REWARD 3]"), 6, "rewards in outcomes are not read"),
        ("rules", rule(outcomes="1"), 6, "says nothing after its probability"),
        ("rules", rule(outcomes="0.5 inhand(X)\n0.2 <noise>"), 7, "the probabilities sum to 0.7; valid: 1"),
        ("rules", rule(outcomes="0.7 inhand(X)\n0.7 <no-change>"), 7, "sum to 1.4; valid: 1"),
        ("rules", rule(outcomes="half inhand(X)"), 6, "'half' is not a number"),
        ("rules", rule(outcomes="nan inhand(X)"), 6, "'nan' is not a number"),
        ("rules", rule(outcomes="inf inhand(X)"), 6, "'inf' is not a number"),
        ("rules", rule(outcomes="1.5 inhand(X)"), 6, "'1.5' is not a probability; valid: 0 to 1"),
        ("rules", rule(outcomes="-0.5 inhand(X)"), 6, "'-0.5' is not a probability; valid: 0 to 1"),
        ("rules", rule(outcomes="0.5 <noise>\n0.5 inhand(X)"), 7, "an outcome stands after <noise>"),
        ("rules", rule(outcomes="1 <noise>"), 6, "no outcome besides noise"),
        ("rules", rule(head="default()", context="--", outcomes="1 inhand(X)"), 6, "default rule changes"),
        ("rules", rule(head="default()", context="--", outcomes="1 <no-change>"), 6, "no rule besides"),
        ("rules", b"ACTION:\n\xff\xfe\x00", 2, "no UTF-8 text"),
        ("state", "", 1, "there is nothing in this state file"),
        ("state", "on(61 60)\non(60)", 2, "on takes 2 arguments, here it has 1"),
        ("state", "on(61 60)\n-on(61 60)", 2, "'on(61,60)' is said to be both true and false"),
        ("state", "on(X 60)", 1, "X is a variable, not for a state"),
        ("state", "onn(61 60)", 1, "unknown symbol 'onn' (did you mean on?); valid: above"),
        ("state", "grab(61)", 1, "grab is declared as action, which cannot stand in a state"),
        ("state", b"\x00\x01\x02", 1, "cannot read 'unprintable characters'"),
        ("goal", "\n\n", 1, "there is nothing in this goal file"),
        ("goal", "# a goal\non(61 60) -on(61 60)", 2, "both true and false"),
        ("goal", "on(61 7)", 1, "7 is a variable, not for a goal"),
        ("goal", "(((", 1, "the parenthesis in '(((' is not closed"),
    ],
)
def test_malformed(tmp_path: Path, name: str, text: str | bytes, line: int, message: str) -> None:
    with pytest.raises(RuleError) as raised:
        load(write(tmp_path, **{name: text}))
    found = str(raised.value)
    assert f"{name}.dat, line {line}: " in found
    assert message in found
    assert "\n" not in found


def test_missing_files_and_folders(tmp_path: Path) -> None:
    write(tmp_path)
    (tmp_path / "goal.dat").unlink()
    with pytest.raises(RuleError, match=r"no goal file at '.*goal\.dat'"):
        load(tmp_path)
    (tmp_path / "goal.dat").mkdir()
    with pytest.raises(RuleError, match="is not a file; a goal file is needed"):
        load(tmp_path)


def test_with_many_symbols_the_message_stays_short(tmp_path: Path) -> None:
    symbols = "".join(f"thing{n} 0 primitive binary\n" for n in range(300)) + "grab 1 action binary\n"
    with pytest.raises(RuleError) as raised:
        load(write(tmp_path, symbols=symbols, rules=rule("--", "1 thing1()"), state="thingy7()"))
    assert "did you mean thing7?" in str(raised.value)
    assert "and 290 more, 300 in all" in str(raised.value)
    assert len(str(raised.value)) < 500


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("alphabet", [bytes(range(256)), b"abXY()-_<>=,. \n", b"a(", b"\n", b"# \n", b"a"])
def test_noise_fails_at_once(tmp_path: Path, name: str, alphabet: bytes) -> None:
    noise = bytes(random.Random(7).choices(alphabet, k=100_000)) * 100
    folder = write(tmp_path, **{name: noise})
    start = time.process_time()
    with pytest.raises(RuleError, match=rf"{name}\.dat, line \d+: ") as raised:
        load(folder)
    assert time.process_time() - start < 2
    assert len(str(raised.value)) < 500


def test_too_many_groundings_are_refused(tmp_path: Path) -> None:
    symbols = "move 4 action binary\non 2 primitive binary\ntable 1 primitive binary\n"
    rules = rule("--", "1 on(X Y) on(Z V)", "move(X Y Z V)")
    facts = " ".join(f"table({n})" for n in range(10, 60))
    with pytest.raises(RuleError, match=r"rules\.dat, line 2: .*too many groundings; valid: at most"):
        load(write(tmp_path, symbols=symbols, rules=rules, state=facts, goal="on(10 11)"))


def test_too_large_definitions_are_refused(tmp_path: Path) -> None:
    symbols = SYMBOLS + "many 1 conjunction binary <-- on(Y Z) on(Z V) on(V W)\n"
    facts = " ".join(f"on({n} {n + 1})" for n in range(10, 60))
    with pytest.raises(RuleError, match=r"symbols\.dat, line 3: .*many is too large; valid: at most"):
        load(write(tmp_path, symbols=symbols, rules=rule(), state=facts, goal="many(10)"))
