from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cognitive_arch.affordances import mixture
from cognitive_arch.affordances.evaluation import PROTOCOLS, evaluate, splits, without_start
from cognitive_arch.affordances.features import described_by, soft_bins
from cognitive_arch.affordances.forest import ForestCPD
from cognitive_arch.affordances.metrics import match_distance, reliability, scores, winners
from cognitive_arch.affordances.mixture import MixtureModel
from cognitive_arch.affordances.model import coupled, marginals_of
from cognitive_arch.affordances.process import ProcessCPD
from cognitive_arch.affordances.published import read_published
from cognitive_arch.affordances.registry import BASELINES, MODELS, Affordances
from cognitive_arch.affordances.trials import TrialTable, action_index
from cognitive_arch.errors import AffordanceError
from tests.affordances.synthetic import synthetic_trials

RNG = np.random.default_rng


@pytest.fixture(scope="module")
def learned(trials: TrialTable) -> dict[str, Affordances]:
    return {name: Affordances.learn(trials, name, RNG(0)) for name in MODELS}


@pytest.mark.parametrize("name", MODELS)
def test_every_model_gives_distributions_and_knows_what_pulling_does(
    learned: dict[str, Affordances], name: str
) -> None:
    test = synthetic_trials(200, seed=9)
    joint = learned[name].model.joint(test)
    assert joint.shape == (200, 5, 5)
    assert (joint >= 0).all()
    np.testing.assert_allclose(joint.sum(axis=(1, 2)), 1.0, atol=1e-6)
    assert scores(joint, test.bins).accuracy > 0.55
    # Components and K2's price for configurations of all actions hide the tool at so few trials.
    if name not in ("majority", "pca", "pca-two-blocks", "k2"):
        pulls = test.action == action_index("pull")
        closer = joint[pulls, 3:].sum(axis=(1, 2))
        stick = test.manipulator[pulls] == "stick"
        assert closer[~stick].mean() > closer[stick].mean() + (0.1 if name == "full" else 0.4)


@pytest.mark.parametrize("name", sorted(set(MODELS) - {"forest", "logistic"}))
def test_models_survive_their_files(
    learned: dict[str, Affordances], trials: TrialTable, name: str, tmp_path: Path
) -> None:
    learned[name].save(tmp_path / "model.json")
    again = Affordances.load(tmp_path / "model.json")
    assert again.trials == 400
    assert set(again.things_m) == {"hook", "rake", "stick"}
    some = trials.take(np.arange(40))
    np.testing.assert_allclose(again.model.joint(some), learned[name].model.joint(some), atol=1e-4)


@pytest.mark.parametrize("name", ["default", "pca", "mcmc", "majority", "logistic"])
def test_models_learn_from_single_trials(trials: TrialTable, name: str) -> None:
    model = MODELS[name].fit(trials.take(np.arange(80)), RNG(0))
    surprise = trials.take(np.array([80]))
    surprise = replace(surprise, effect=np.array([[-0.2, 0.2]]))
    before = model.joint(surprise)[0, 0, 4]
    for _ in range(3):
        model.update(surprise, RNG(0))
    assert model.joint(surprise)[0, 0, 4] > before


@pytest.mark.parametrize("name", MODELS)
def test_a_handful_of_trials_is_enough_to_start(trials: TrialTable, name: str) -> None:
    """One axis without any movement, one action never tried, three trials."""
    few = trials.take(np.flatnonzero(trials.action == action_index("push"))[:3])
    effect = np.array([[-0.1, 0.0], [0.0, 0.0], [-0.1, 0.0]])
    model = MODELS[name].fit(replace(few, effect=effect), RNG(0))
    joint = model.joint(trials.take(np.arange(8)))
    np.testing.assert_allclose(joint.sum(axis=(1, 2)), 1.0, atol=1e-6)


def test_the_same_seed_learns_the_same(trials: TrialTable) -> None:
    first, second = (MODELS["default"].fit(trials, RNG(3)).joint(trials) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_a_place_not_told_is_averaged_over(learned: dict[str, Affordances], trials: TrialTable) -> None:
    some = without_start(trials.take(np.arange(8)))
    joint = learned["default"].model.joint(some)
    np.testing.assert_allclose(joint.sum(axis=(1, 2)), 1.0)


def test_networks_learn_where_descriptors_are_missing(trials: TrialTable) -> None:
    holes = trials.shape_m.copy()
    holes[RNG(0).random(holes.shape) < 0.1] = np.nan
    model = MODELS["k2"].fit(replace(trials, shape_m=holes), RNG(0))
    test = synthetic_trials(100, seed=5)
    assert scores(model.joint(test), test.bins).accuracy > 0.55
    with pytest.raises(AffordanceError, match="every descriptor"):
        MODELS["pca"].fit(replace(trials, shape_m=holes), RNG(0))


def test_a_descriptor_of_which_nothing_is_known_leaves_numbers(trials: TrialTable, tmp_path: Path) -> None:
    holes = trials.shape_o.copy()
    holes[:, 0] = np.nan
    table = replace(trials, shape_o=holes)
    Affordances.learn(table, "default", RNG(0)).save(tmp_path / "model.json")
    assert "NaN" not in (tmp_path / "model.json").read_text()
    joint = Affordances.load(tmp_path / "model.json").model.joint(table)
    np.testing.assert_allclose(joint.sum(axis=(1, 2)), 1.0, atol=1e-6)


def test_trees_and_process_look_at_places_only_if_all_are_known(
    trials: TrialTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor do those that the weights are found with, though one fold knows all of its own."""
    start = trials.start.copy()
    start[0] = np.nan
    looked = []
    for part in (ProcessCPD, ForestCPD):
        monkeypatch.setattr(part, "marginals", _told(part.marginals, looked))
    MixtureModel.fit(replace(trials, start=start), RNG(0))
    assert len(looked) >= 8
    assert not any(looked)


def _told(marginals: Any, looked: list[bool]) -> Any:
    def noted(self: Any, table: TrialTable) -> Any:
        looked.append(self.with_start)
        return marginals(self, table)

    return noted


def test_without_places_none_counts(trials: TrialTable) -> None:
    model = MixtureModel.fit(without_start(trials), RNG(0))
    assert not model.counts(np.array([[-0.45, 0.1], [-1.5, 1.0]])).any()
    assert MixtureModel.fit(trials, RNG(0)).counts(np.array([[-0.45, 0.1], [-9.0, 9.0]])).tolist() == [
        True,
        False,
    ]


def test_the_newest_trials_are_kept_of_many(trials: TrialTable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mixture, "MOST_ROWS", 50)
    model = MixtureModel.fit(trials.take(np.arange(80)), RNG(0))
    new = trials.take(np.arange(80, 90))
    model.update(new, RNG(0))
    assert model.seen is not None
    assert len(model.seen) == 50
    assert np.array_equal(model.seen.effect[-10:], new.effect)


def test_a_model_that_goes_on_learning_knows_the_new_places(trials: TrialTable) -> None:
    model = MixtureModel.fit(trials.take(np.arange(40)), RNG(0))
    further = trials.take(np.arange(40, 80))
    model.update(replace(further, start=further.start + 1.0), RNG(0))
    assert (model.places > trials.start.max()).any()


def test_a_model_is_kept_whole_or_not_at_all(
    learned: dict[str, Affordances], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that is full leaves the model that was there."""
    path = tmp_path / "model.json"
    learned["majority"].save(path)
    before = path.read_bytes()

    def full(self: Path, content: bytes) -> int:
        with self.open("wb") as stream:
            stream.write(content[:10])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space"):
        learned["default"].save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_model_is_kept_where_a_link_leads_and_in_devices(
    learned: dict[str, Affordances], tmp_path: Path
) -> None:
    real, link = tmp_path / "real.json", tmp_path / "link.json"
    real.write_text("")
    real.chmod(0o600)
    link.symlink_to(real)
    learned["majority"].save(link)
    assert link.is_symlink()
    assert Affordances.load(real).trials == 400
    assert real.stat().st_mode & 0o777 == 0o600
    learned["majority"].save("/dev/null")
    assert not Path("/dev/null").is_file()


def test_what_was_never_seen_is_a_random_prediction(trials: TrialTable) -> None:
    model = MODELS["full"].fit(trials, RNG(0))
    strange = replace(trials.take(np.arange(4)), shape_o=np.full((4, 3), 0.0), shape_m=np.ones((4, 3)))
    assert model.unseen(strange).mean() > 0.9
    assert scores(model.joint(strange), strange.bins).accuracy == pytest.approx(0.2)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_splits_share_no_trial_but_in_the_leaky_protocol(trials: TrialTable, protocol: str) -> None:
    views = {str(n): RNG(0).random((4, 3)) for n in np.unique(np.r_[trials.manipulator, trials.object])}
    table = replace(trials, views_m=views, views_o=views)
    shared = 0
    for split in splits(table, protocol, 2, RNG(0)):
        shared += len(set(split.train.trial) & set(split.test.trial))
        if protocol == "leave-one-object-out":
            assert not set(split.train.object) & set(split.test.object)
    assert (shared > 0) == (protocol == "published")


def test_scores_of_known_cases() -> None:
    sure = np.zeros((2, 5, 5))
    sure[:, 2, 4] = 1.0
    found = scores(sure, np.array([[2, 4], [0, 4]]))
    assert found.accuracy == 0.75
    assert found.distance == pytest.approx(0.125)
    assert found.brier == pytest.approx(0.5)
    assert found.joint_accuracy == 0.5
    assert found.ece == pytest.approx(0.25)
    uniform = scores(np.full((1, 5, 5), 0.04), np.array([[1, 3]]))
    assert uniform.accuracy == pytest.approx(0.2)
    assert uniform.log_likelihood == pytest.approx(np.log(0.2))
    assert winners(np.array([0.4, 0.4, 0.2])).tolist() == [0.5, 0.5, 0.0]
    assert match_distance(np.eye(5)[0], np.eye(5)[4]) == 4.0


def test_reliability_of_a_fair_forecast() -> None:
    rng = RNG(0)
    p = rng.random(20_000)
    assert reliability(p, rng.random(20_000) < p).error < 0.02
    assert reliability(p, rng.random(20_000) < p**2).error > 0.1


def test_coupling_keeps_the_marginals() -> None:
    rng = RNG(0)
    marginals = rng.dirichlet(np.ones(5), (7, 2))
    joint = coupled(marginals, rng.uniform(0.3, 3.0, (7, 5, 5)))
    np.testing.assert_allclose(marginals_of(joint), marginals, atol=1e-4)


def test_soft_bins_share_what_lies_on_an_edge() -> None:
    soft = soft_bins(np.array([0.0, 0.06, 0.3]))
    np.testing.assert_allclose(soft.sum(axis=1), 1.0)
    assert soft[1, 3] == pytest.approx(soft[1, 4], abs=0.02)
    assert soft[2, 4] > 0.999


def test_default_beats_the_majority_on_published_trials(published: Path) -> None:
    """Few splits only; benchmarks/affordances.py measures with twenty."""
    for name, margin in (("hand", 0.02), ("tool", 0.03)):
        table = read_published(published, name)
        ours, majority = (evaluate(table, m, "trial", 4, 5) for m in ("default", "majority"))
        assert ours.mean("accuracy") > majority.mean("accuracy") + margin
        assert ours.mean("log_likelihood") > majority.mean("log_likelihood") + 0.05


def test_baselines_are_models() -> None:
    assert set(BASELINES) < set(MODELS)
    with pytest.raises(AffordanceError, match="unknown model 'best'"):
        Affordances.learn(synthetic_trials(40), "best", RNG(0))


def test_each_action_weighs_for_itself_what_matters_to_it() -> None:
    """Where three actions out of four do the same with every tool, pulls must not be taken for such, too."""
    table = synthetic_trials(1200, seed=3)
    others = table.action != action_index("pull")
    effect = np.where(others[:, None], table.effect.mean(axis=0), table.effect)
    same = replace(table, effect=effect)
    model = MODELS["default"].fit(same, RNG(0))
    pulls = same.take(~others)
    closer = model.joint(pulls)[:, 3:].sum(axis=(1, 2))
    for tool in ("stick", "hook", "rake"):
        mine = pulls.manipulator == tool
        assert closer[mine].mean() == pytest.approx((pulls.effect[mine, 0] > 0.025).mean(), abs=0.2), tool


def test_a_packed_file_holds_the_same_and_a_broken_one_is_refused(
    learned: dict[str, Affordances], tmp_path: Path
) -> None:
    plain, packed = tmp_path / "model.json", tmp_path / "model.json.gz"
    learned["default"].save(plain)
    learned["default"].save(packed)
    assert packed.stat().st_size < plain.stat().st_size / 2
    some = synthetic_trials(20)
    joint = Affordances.load(packed).model.joint(some)
    np.testing.assert_array_equal(joint, Affordances.load(plain).model.joint(some))
    first = packed.read_bytes()
    learned["default"].save(packed)
    assert packed.read_bytes() == first
    for broken in (first[:-9], b"no archive", plain.read_bytes()):
        packed.write_bytes(broken)
        with pytest.raises(AffordanceError, match=r"'model.json.gz' is no learned model"):
            Affordances.load(packed)


def test_only_the_descriptors_asked_for_are_learned_from() -> None:
    table = described_by(synthetic_trials(80), ["convexity", "compactness"])
    assert table.names_m == table.names_o == ("convexity", "compactness")
    assert table.shape_m.shape == table.shape_o.shape == (80, 2)
    np.testing.assert_array_equal(table.shape_m[:, 0], synthetic_trials(80).shape_m[:, 0])
    with pytest.raises(AffordanceError, match="unknown descriptor 'weight'; valid: compactness, convexity"):
        described_by(table, ["weight"])
