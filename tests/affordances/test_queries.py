from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cognitive_arch.affordances.figures import dot, graph_picture
from cognitive_arch.affordances.queries import Lookup, Oracle, goal_mask, matrix_text
from cognitive_arch.affordances.registry import Affordances
from cognitive_arch.affordances.structures import named_structure
from cognitive_arch.affordances.transfer import JOINT, TOOLS, selection_table, success_rates, transfer_curve
from cognitive_arch.affordances.trials import TrialTable, action_index, write_trials
from cognitive_arch.errors import AffordanceError
from tests.affordances.synthetic import synthetic_frame, synthetic_trials

RNG = np.random.default_rng


@pytest.fixture(scope="module")
def learned(trials: TrialTable) -> Affordances:
    return Affordances.learn(trials, "default", RNG(0))


@pytest.fixture(scope="module")
def oracle(learned: Affordances) -> Oracle:
    return Oracle(learned)


def test_wishes_are_cells() -> None:
    assert goal_mask("closer").sum() == 10
    assert goal_mask("closer+left").sum() == 4
    assert goal_mask("still").tolist()[2] == [False, False, True, False, False]
    assert goal_mask("x=VP;y=NM").sum() == 1
    for wrong in ("up", "x=BIG", "closer+away", ""):
        with pytest.raises(AffordanceError):
            goal_mask(wrong)


def test_the_right_tool_and_the_right_action_are_chosen(oracle: Oracle) -> None:
    tools = [oracle.manipulator(name) for name in ("stick", "hook", "rake")]
    box = oracle.object("box")
    ranked = oracle.select_tool(goal_mask("closer"), "pull", tools, box)
    assert list(ranked)[-1] == "stick"
    assert sum(share for _, share in ranked.values()) == pytest.approx(1.0)
    for goal, action in (("closer", "pull"), ("away", "push"), ("left", "tapFromRight")):
        assert next(iter(oracle.select_action(goal_mask(goal), tools[1], box))) == action


def test_a_tool_of_known_shape_needs_no_name(oracle: Oracle) -> None:
    like_a_hook = oracle.manipulator("convexity=0.69,eccentricity=0.46,compactness=0.25")
    closer = goal_mask("closer")
    by_shape, stick = (
        oracle.predict("pull", m, oracle.object("box"))[closer].sum()
        for m in (like_a_hook, oracle.manipulator("stick"))
    )
    assert by_shape > stick + 0.4


def test_what_is_left_open_is_averaged_over(oracle: Oracle, learned: Affordances) -> None:
    tools = [oracle.manipulator(n) for n in learned.things_m]
    objects = [oracle.object(n) for n in learned.things_o]
    each = [oracle.predict("pull", m, o) for m in tools for o in objects]
    np.testing.assert_allclose(oracle.predict("pull"), np.mean(each, axis=0), atol=1e-9)
    assert oracle.predict().sum() == pytest.approx(1.0)


def test_look_ups_are_the_models_own_answers(oracle: Oracle) -> None:
    tools = [oracle.manipulator(n) for n in ("stick", "hook")]
    objects = [oracle.object(n) for n in ("ball", "box")]
    lookup = Lookup.of(oracle.learned, tools, objects, ((-0.6, -0.2), (-0.3, 0.2)), cells=3)
    middle = (-0.45, 0.0)
    np.testing.assert_allclose(
        lookup(2, 1, 0, middle), oracle.predict("pull", tools[1], objects[0], middle), atol=1e-9
    )
    np.testing.assert_array_equal(lookup(2, 1, 0, (-9.0, -9.0)), lookup(2, 1, 0, (-0.55, -0.15)))
    anywhere = Lookup.of(oracle.learned, tools, objects)
    np.testing.assert_allclose(anywhere(3, 0, 1), oracle.predict("push", tools[0], objects[1]), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("spoon", "unknown manipulator 'spoon'.*stick"),
        ("convexity=0.5", "lacks the descriptors eccentricity, compactness"),
        ("colour=3", "unknown descriptor 'colour'"),
        ("convexity=much", "convexity is 'much'"),
        ("convexity=nan,eccentricity=1,compactness=1", "convexity is 'nan'"),
    ],
)
def test_bad_things_are_named(oracle: Oracle, text: str, message: str) -> None:
    with pytest.raises(AffordanceError, match=message):
        oracle.manipulator(text)


def test_the_matrix_is_written_closer_first() -> None:
    joint = np.zeros((5, 5))
    joint[4, 0] = 1.0
    rows = matrix_text(joint).splitlines()
    assert rows[2].split() == ["closer", "VP", "1.0000", "0.0000", "0.0000", "0.0000", "0.0000"]


def test_hands_help_where_trials_with_tools_are_few() -> None:
    hands, tools = synthetic_trials(200, 1, "hand"), synthetic_trials(120, 2)
    curve = transfer_curve(hands, tools, "bde", (0, 8, 64), repetitions=3)
    assert curve.counts == (0, 8, 64)
    assert np.isnan(curve.accuracy[TOOLS][0]).all()
    assert curve.accuracy[JOINT][1].mean() > curve.accuracy[TOOLS][1].mean() + 0.1


def test_tools_are_selected_as_they_work(learned: Affordances, trials: TrialTable) -> None:
    rows = {n: trials.take(trials.manipulator == n) for n in ("stick", "hook", "rake")}
    table = selection_table({n: (part, learned.model.joint(part)) for n, part in rows.items()})
    worked = success_rates(trials)
    assert table["pull"]["stick"] < 0.1 < 0.9 < table["pull"]["hook"]
    assert worked["pull"]["stick"] < 0.2 < 0.8 < worked["pull"]["hook"]


@pytest.mark.parametrize("suffix", [".png", ".svg", ".dot"])
def test_networks_are_drawn(tmp_path: Path, suffix: str) -> None:
    path = graph_picture(named_structure("fig40-k2"), tmp_path / f"graph{suffix}")
    assert path.stat().st_size > 500
    if suffix == ".dot":
        assert '"1" -> "11";' in dot(named_structure("fig40-k2"))
    with pytest.raises(AffordanceError, match="is no picture"):
        graph_picture(named_structure("pca"), tmp_path / "graph.pdf.exe")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory, trials: TrialTable) -> Path:
    folder = tmp_path_factory.mktemp("affordances")
    write_trials(trials, folder / "trials.csv")
    return folder


def test_learn_and_ask_from_the_command_line(cogarch: Any, files: Path) -> None:
    model = files / "model.json"
    found = cogarch(
        "learn", "networks", str(files / "trials.csv"), "--model", "bde", "--out", str(model),
        "--graph", str(files / "graph.svg"), "--evaluate", "2", "--json",
        "--reliability", str(files / "reliability.png"),
    )  # fmt: skip
    answer: dict[str, Any] = found.json
    assert found.code == 0
    assert answer["trials"] == 400
    assert [row["model"] for row in answer["evaluation"]] == ["bde", "majority", "forest", "logistic"]
    assert (files / "graph.svg").exists()
    assert (files / "reliability.png").stat().st_size > 5000
    found = cogarch(
        "query", str(model), "--action", "pull", "--goal", "closer", "--object", "box", "--json",
        "--picture", str(files / "effects.png"),
    )  # fmt: skip
    answer = found.json
    assert found.code == 0
    assert answer["kind"] == "tool"
    assert answer["choice"] in ("hook", "rake")
    assert (files / "effects.png").stat().st_size > 5000
    found = cogarch("query", str(model), "--action", "push", "--manipulator", "rake", "--json")
    assert np.sum(found.json["effects"]) == pytest.approx(1.0)


def test_without_a_model_what_comes_along_is_asked(cogarch: Any) -> None:
    found = cogarch("query", "--action", "pull", "--goal", "closer", "--tools", "Stick,Hook-left", "--json")
    assert found.code == 0
    assert found.json["choice"] == "Hook-left"


def test_it_is_told_when_the_place_makes_no_difference(cogarch: Any, files: Path) -> None:
    asked = ("query", "--action", "pull", "--manipulator", "Rake")
    near, far, none = (
        cogarch(*asked, *start, "--json").json for start in (("--start=-0.45,0.1",), ("--start=99,99",), ())
    )
    assert [answer["start_counts"] for answer in (near, far, none)] == [True, False, False]
    assert far["effects"] == none["effects"] != near["effects"]
    assert "not looked at" in cogarch(*asked, "--start=99,99").out
    assert "not looked at" not in cogarch(*asked, "--start=-0.45,0.1").out


def test_ties_and_what_was_never_tried_are_told(cogarch: Any, trials: TrialTable, tmp_path: Path) -> None:
    pulls = trials.take(trials.action == action_index("pull"))
    for model in ("majority", "default"):
        Affordances.learn(pulls, model, np.random.default_rng(0)).save(tmp_path / f"{model}.json")
    tie = cogarch("query", str(tmp_path / "majority.json"), "--action", "pull", "--goal", "closer")
    assert "best         none of them: all are as likely" in tie.out
    assert "never tried" not in tie.out
    asked = ("query", str(tmp_path / "default.json"), "--manipulator", "rake", "--goal", "closer")
    assert "never tried  tapFromRight, tapFromLeft, push:" in cogarch(*asked).out
    assert "best         pull" in cogarch(*asked).out
    answer = cogarch(*asked, "--json").json
    assert (answer["choice"], answer["never_tried"]) == ("pull", ["tapFromRight", "tapFromLeft", "push"])


def test_a_picture_shows_the_likeliest_of_many(cogarch: Any, tmp_path: Path) -> None:
    tools = ("--tools", "Stick,Nail,Thick-stick,Short-stick,Rake")
    path = tmp_path / "effects.png"
    found = cogarch("query", "--action", "pull", "--goal", "closer", *tools, "--picture", str(path), "--json")
    assert found.json["drawn"][0] == f"pull with {found.json['choice']}" == "pull with Rake"
    assert len(found.json["drawn"]) == 4
    assert path.stat().st_size > 5000


def test_things_may_be_shown_in_a_picture(cogarch: Any, learned: Affordances, tmp_path: Path) -> None:
    import cv2

    picture = np.full((240, 320, 3), 150, np.uint8)
    cv2.rectangle(picture, (140, 60), (152, 200), (20, 30, 200), -1)
    cv2.circle(picture, (60, 120), 22, (200, 60, 20), -1)
    cv2.imwrite(str(tmp_path / "view.png"), picture)
    learned.save(tmp_path / "model.json")
    view = str(tmp_path / "view.png")
    arguments = ["query", str(tmp_path / "model.json"), "--action", "pull", "--json"]
    found = cogarch(*arguments, "--manipulator", f"{view}#1", "--object", f"{view}#2")
    assert found.code == 0
    assert found.json["asked"]["manipulator"] == "view.png#1"
    assert np.sum(found.json["effects"]) == pytest.approx(1.0)
    for wrong, message in ((f"{view}#9", "valid: 1 to 2"), ("none.png", "none.png")):
        found = cogarch(*arguments, "--object", wrong)
        assert (found.code, len(found.err.splitlines())) == (2, 1)
        assert message in found.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["learn", "networks", "hand"], "say with --data"),
        (["learn", "networks", "absent.csv"], "no file of trials"),
        (["learn", "networks", "TRIALS", "--model", "best"], "unknown model 'best'"),
        (["learn", "networks", "TRIALS", "--protocol", "none"], "unknown protocol 'none'"),
        (["learn", "networks", "TRIALS", "--model", "forest", "--out", "f.json"], "for comparison"),
        (["learn", "networks", "TRIALS", "--reliability", "r.png"], "needs --evaluate"),
        (["learn", "networks", "TRIALS", "--out", "TRIALS"], "holds something else than a learned model"),
        (["learn", "networks", "TRIALS", "--seed", "-1"], "seed -1; valid: 0 or more"),
        (
            ["learn", "networks", "TRIALS", "--model", "k2", "--graph", "g.pdf"],
            "valid: .png, .svg, .dot, .bif",
        ),
        (["reproduce", "fig46", "--seed", "-4"], "seed -4; valid: 0 or more"),
        (["reproduce", "fig46", "--jobs", "0"], "0 jobs; valid: 1 to 1024"),
        (["query", "TRIALS"], "is no learned model"),
        (["query", "--formulas", "mine"], "unknown set of formulas 'mine'"),
        (["query", "--action", "pull", "--tools", "Stick,Rake"], "--goal closer"),
        (["reproduce", "table10"], "never published"),
        (["reproduce", "table9", "--trials", "absent.csv"], "no file of trials"),
        (["reproduce", "fig47", "--trials", "TRIALS"], "both kinds"),
    ],
)
def test_bad_calls_end_with_one_line(cogarch: Any, files: Path, arguments: list[str], message: str) -> None:
    before = (files / "trials.csv").read_bytes()
    found = cogarch(*[str(files / "trials.csv") if a == "TRIALS" else a for a in arguments])
    assert (found.code, found.out) == (2, "")
    assert (files / "trials.csv").read_bytes() == before
    assert message in found.err
    assert len(found.err.strip().splitlines()) == 1


def test_table_6_is_reproduced(cogarch: Any, tmp_path: Path) -> None:
    found = cogarch("reproduce", "table6", "--out", str(tmp_path), "--json")
    answer = found.json
    assert (found.code, answer["success"]) == (0, True)
    assert sorted(answer["complexity"].values()) == [168, 535, 1594, 21_257_680]


def test_tables_of_ones_own_trials(cogarch: Any, tmp_path: Path) -> None:
    frame = synthetic_frame(160)
    frame.to_csv(tmp_path / "tools.csv", index=False)
    found = cogarch(
        "reproduce", "fig46", "--trials", str(tmp_path / "tools.csv"), "--out", str(tmp_path), "--json"
    )
    answer = found.json
    assert found.code == 0
    assert answer["checks"][2]["ours"] == "hook"
    assert (tmp_path / "fig46.png").exists()


def test_published_tables_are_compared(cogarch: Any, published: Path, tmp_path: Path) -> None:
    found = cogarch("reproduce", "fig47", "--data", str(published), "--out", str(tmp_path), "--json")
    assert (found.code, found.json["success"]) == (0, True)
    found = cogarch("reproduce", "table12", "--data", str(published), "--out", str(tmp_path), "--json")
    answer = found.json
    assert [check["holds"] for check in answer["checks"][:3]] == [True, True, True]
    assert answer["worked"]["pull"]["stick"] == 0.0


@pytest.mark.parametrize("trials", ["own", "published"])
def test_who_knows_hands_ranks_tools_for_pulling(
    cogarch: Any, trials: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    given = (
        ("--trials", "explored") if trials == "own" else ("--data", str(request.getfixturevalue("published")))
    )
    found = cogarch("reproduce", "table12", *given, "--out", str(tmp_path), "--json")
    expected = found.json["pull_expected"]
    assert expected["rake"] > expected["hook"] > expected["stick"]
