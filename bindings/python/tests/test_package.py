"""Tests of the package with the command line, scikit-learn, aeon and real channels.

    TACTNET=target/release/tactnet python -m pytest bindings/python/tests
"""

import asyncio
import json
import os
import pickle
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import tactnet

TACTNET = os.environ.get("TACTNET", "tactnet")
HERE = Path(__file__).parent


def cli(*arguments, **options):
    return subprocess.run([TACTNET, *map(str, arguments)], check=True, capture_output=True, text=True, **options).stdout


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A small twin as NumPy arrays, with the split of the command line."""
    twin = tactnet.Dataset.twin(materials=4, sweeps=15, steps=300)
    file = tmp_path_factory.mktemp("data") / "own.npz"
    np.savez_compressed(file, X=twin.X, y=twin.y, sample_rate_hz=750)
    own = tactnet.Dataset.read(file)
    train, test = own.folds()[0]
    return own, file, train, test


@pytest.fixture(scope="module")
def network(data):
    own, _, train, _ = data
    return tactnet.TactNetClassifier(rate=own.rate, epochs=5).fit(own.X[train], own.y[train])


def test_arrays_come_back_as_they_were():
    X = np.arange(3 * 50 * 6, dtype=np.int64).reshape(3, 50, 2, 3) % 251
    data = tactnet.Dataset.from_arrays(X, ["wood", "cork", "wood"], rate=120, blocks=[4, 4, 5])
    assert (data.X == X).all() and data.X.dtype == np.uint8
    assert data.y.tolist() == ["wood", "cork", "wood"] and data.materials == ["cork", "wood"]
    assert (data.rate, data.rate_is_assumed, data.blocks.tolist()) == (120, False, [4, 4, 5])
    assert tactnet.Dataset.from_arrays(X * 300, [1, 2, 1]).X.dtype == np.float32
    assert tactnet.Dataset.from_arrays(X + 200, [1, 2, 1]).X.dtype == np.uint16
    assert tactnet.Dataset.from_arrays(X.astype(np.float16), [1, 2, 1]).rate_is_assumed
    kinds = {finding.kind for finding in tactnet.Dataset.from_arrays(X[:, :20], [1, 2, 1]).check()}
    assert {"few_sweeps", "assumed_rate", "short_sweeps"} <= kinds


@pytest.mark.parametrize(
    "X, complaint",
    [
        (np.zeros((3, 4)), "found shape (3, 4)"),
        (np.zeros((0, 4, 4)), "at least one sweep"),
        (np.array([[["a"]]]), "expected numbers"),
        (np.full((2, 3, 4), 1e300), "32-bit float"),
        (1.6e9 + np.arange(24.0).reshape(2, 3, 4), "keeps steps of 128"),
        (np.full((2, 3, 4), 1 << 60), "32-bit float"),
        (np.zeros((3, 4, 4)), "found 2"),
    ],
)
def test_other_arrays_are_refused_in_a_line(X, complaint):
    with pytest.raises(tactnet.TactnetError) as refused:
        tactnet.Dataset.from_arrays(X, ["wood", "cork"])
    assert complaint in str(refused.value) and "\n" not in str(refused.value)
    assert isinstance(refused.value, ValueError)


def test_equal_seeds_give_the_bits_of_the_command_line(data, network, tmp_path):
    own, file, train, test = data
    run = tmp_path / "run"
    cli("train", "--recipe", "fast", "--data", file, "--epochs", 5, "--out", run)
    found = json.loads(cli("predict", run, "--data", file, "--json"))
    assert found["materials"] == network.classes_.tolist()
    theirs = np.array([sweep["probabilities"] for sweep in found["sweeps"]])
    assert np.abs(theirs - network.predict_proba(own.X)).max() < 1e-12
    split = json.loads((run / "split.json").read_text())
    assert split["train"] == train.tolist() and split["test"] == test.tolist()
    # The package opens a run of the command line.
    loaded = tactnet.TactNetClassifier.load(run)
    assert np.abs(loaded.predict_proba(own.X) - theirs).max() < 1e-12


def test_what_is_saved_is_opened_by_the_command_line(data, network, tmp_path):
    own, file, _, test = data
    network.save(tmp_path / "saved")
    found = json.loads(cli("predict", tmp_path / "saved", "--data", file, "--json"))
    theirs = [sweep["material"] for sweep in found["sweeps"]]
    assert theirs == network.predict(own.X).tolist()
    with pytest.raises(tactnet.TactnetError):
        network.save(tmp_path / "saved")


def test_estimators_fit_into_scikit_learn(data):
    from sklearn.base import clone
    from sklearn.model_selection import GridSearchCV, cross_val_score
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer

    own, *_ = data
    X, y = own.X, own.y
    search = GridSearchCV(tactnet.KnnClassifier(rate=750), {"features": ["h", "l"]}, cv=2, n_jobs=2).fit(X, y)
    assert search.best_params_["features"] in ("h", "l")
    scores = cross_val_score(tactnet.LdaClassifier(rate=750), X, y, cv=own.folds())
    assert len(scores) == 5 and scores.mean() > 0.5
    half = FunctionTransformer(lambda sweeps: sweeps[:, ::2])
    assert make_pipeline(half, tactnet.SvmClassifier(rate=375)).fit(X, y).score(X, y) > 0.5
    assert clone(tactnet.TactNetClassifier(epochs=3)).epochs == 3
    rocket, quant = tactnet.MiniRocketClassifier(rate=750), tactnet.QuantClassifier(rate=750)
    for estimator in (rocket, quant, tactnet.SvmClassifier(features="spectra", rate=750)):
        fitted = estimator.fit(X, np.unique(y, return_inverse=True)[1])
        again = pickle.loads(pickle.dumps(fitted))
        assert again.classes_.tolist() == [0, 1, 2, 3]
        assert (again.predict_proba(X) == fitted.predict_proba(X)).all()


def test_the_checks_of_scikit_learn_pass():
    sys.path.insert(0, str(HERE))
    import quickstart

    for estimator in (quickstart.Flat(), tactnet.TactNetClassifier()):
        counts = quickstart.check(estimator)
        assert counts["failed"] == 0 and counts["passed"] > 0, counts
    assert quickstart.check(quickstart.Flat())["passed"] > 50


def test_predictions_are_a_table_of_pandas(data, network):
    pytest.importorskip("pandas")
    own, _, _, test = data
    table = network.predict_table(own.X[test[:5]])
    assert table.material.tolist() == network.predict(own.X[test[:5]]).tolist()
    assert table.columns[2:].tolist() == [f"p({name})" for name in network.classes_]
    assert np.allclose(table.iloc[:, 2:].sum(axis=1), 1.0) and (table.probability == table.iloc[:, 2:].max(axis=1)).all()


def test_aeon_takes_channels_first(data):
    from tactnet.aeon import TactnetAeonClassifier

    own, _, train, test = data
    X = own.X.reshape(len(own), 300, 16).astype(float)
    direct = tactnet.MiniRocketClassifier(rate=750).fit(X[train], own.y[train])
    wrapped = TactnetAeonClassifier(tactnet.MiniRocketClassifier(rate=750))
    wrapped.fit(X[train].swapaxes(1, 2), own.y[train])
    assert (wrapped.predict(X[test].swapaxes(1, 2)) == direct.predict(X[test])).all()
    assert wrapped.predict_proba(X[test].swapaxes(1, 2)).shape == (len(test), 4)


def test_misuse_is_refused(data, network):
    from sklearn.exceptions import NotFittedError

    own, *_ = data
    with pytest.raises(NotFittedError):
        tactnet.TactNetClassifier().predict(own.X)
    with pytest.raises(ValueError, match="at least two materials"):
        tactnet.LdaClassifier().fit(own.X[:5], ["wood"] * 5)
    with pytest.raises(tactnet.TactnetError, match="expected sweeps of 300 steps of 4x4 taxels"):
        network.predict(own.X[:, :200])
    with pytest.raises(tactnet.TactnetError, match="did you mean `fast`"):
        tactnet.TactNetClassifier(recipe="fats").fit(own.X, own.y)
    with pytest.raises(tactnet.TactnetError, match="nothing.h5"):
        tactnet.Dataset.read("nothing.h5")
    with pytest.raises(ValueError, match="NaN"):
        network.predict(np.full((1, 300, 16), np.nan))
    with pytest.raises(tactnet.TactnetError, match="knows a material of this name"):
        network.enroll(own.X[:3], network.classes_[0])


def test_progress_is_seen_and_an_exception_in_it_stops_the_training(data):
    own, *_ = data
    batches = []

    class Stopped(Exception):
        pass

    class Watched(tactnet.TactNetClassifier):
        def _progress(self):
            def watch(epoch, batch, *_):
                batches.append((epoch, batch))
                if epoch == 1:
                    raise Stopped

            return watch

    with pytest.raises(Stopped):
        Watched(epochs=50).fit(own.X, own.y)
    assert batches[0] == (0, 0) and batches[-1] == (1, 0)


def test_one_material_more_and_strange_sweeps(data, network):
    own, _, _, test = data
    others = tactnet.Dataset.twin(materials=6, sweeps=15, steps=300)
    new = others.X[~np.isin(others.y, own.materials)][:5]
    grown = network.enroll(new, "felt")
    assert grown.classes_[-1] == "felt" and "felt" not in network.classes_
    assert (grown.predict(new) == "felt").mean() > (grown.predict(own.X[test]) == "felt").mean()
    scores = network.unknown_score(own.X[test])
    assert scores.shape == (len(test),) and (scores >= 0).all()


def test_adapting_to_another_skin_without_labels_and_with(data, tmp_path):
    own, _, train, test = data
    # Sweeps of the new skin are other sweeps than those of training.
    train, new = train[::2], train[1::2]
    lda = tactnet.LdaClassifier(rate=own.rate).fit(own.X[train], own.y[train])
    gains = np.linspace(0.5, 2, own.X.shape[2]).reshape(1, 1, own.X.shape[2], -1) if own.X.ndim == 4 else np.linspace(0.5, 2, own.X.shape[2])
    other = (own.X * gains + 40).astype(np.float32)
    adapted = lda.adapt(other[new])
    assert (adapted.predict(other[test]) == own.y[test]).mean() > (lda.predict(other[test]) == own.y[test]).mean()
    assert adapted.likeness(other[test])["p"] > lda.likeness(other[test])["p"]
    few = np.concatenate([new[own.y[new] == name][:2] for name in own.materials])
    with pytest.warns(UserWarning, match="8 sweeps are too few"):
        labelled = lda.adapt(other[few], own.y[few])
    labelled.save(tmp_path / "labelled")
    again = tactnet.SweepClassifier.load(tmp_path / "labelled")
    assert (again.predict_log_proba(other[test]) == labelled.predict_log_proba(other[test])).all()
    assert json.loads((tmp_path / "labelled" / "adapted.json").read_text())[0]["presence"]["materials"] == 4
    with pytest.raises(tactnet.TactnetError, match="accept_risk=True"):
        lda.adapt(other[new[own.y[new] == own.materials[0]]])
    with pytest.raises(tactnet.TactnetError, match="`enroll` adds one"):
        lda.adapt(other[few], ["felt"] * len(few))


def test_a_committee_is_the_mean_of_its_members(data, tmp_path):
    from sklearn.base import clone

    own, file, train, test = data
    (tmp_path / "two.toml").write_text('name = "two"\nmembers = ["lda", "minirocket"]')
    committee = tactnet.TactNetCommittee(recipe=tmp_path / "two.toml", rate=own.rate)
    fitted = clone(committee).fit(own.X[train], own.y[train])
    members = [tactnet.LdaClassifier(rate=own.rate), tactnet.MiniRocketClassifier(rate=own.rate)]
    members = [member.fit(own.X[train], own.y[train]) for member in members]
    mean = np.mean([member.predict_proba(own.X[test]) for member in members], axis=0)
    assert np.abs(fitted.predict_proba(own.X[test]) - mean).max() < 1e-12
    assert np.allclose(fitted.unknown_score(own.X[test]), -np.log(mean.max(axis=1)))
    fitted.save(tmp_path / "saved")
    again = tactnet.SweepClassifier.load(tmp_path / "saved")
    assert type(again) is tactnet.TactNetCommittee
    assert (again.predict_proba(own.X[test]) == fitted.predict_proba(own.X[test])).all()
    assert (pickle.loads(pickle.dumps(fitted)).predict(own.X[test]) == fitted.predict(own.X[test])).all()
    found = json.loads(cli("predict", tmp_path / "saved", "--data", file, "--json"))
    assert [sweep["material"] for sweep in found["sweeps"]] == fitted.predict(own.X).tolist()
    with pytest.raises(tactnet.TactnetError, match="use TactNetCommittee.load"):
        tactnet.LdaClassifier.load(tmp_path / "saved")
    # Each member adapts by itself.
    other = own.X * 2.0 + 30
    adapted = fitted.adapt(other[train])
    mean = np.mean([member.adapt(other[train]).predict_proba(other[test]) for member in members], axis=0)
    assert np.abs(adapted.predict_proba(other[test]) - mean).max() < 1e-9


def test_a_committee_learns_a_material_as_if_trained_with_it(data, tmp_path):
    own, _, train, test = data
    (tmp_path / "two.toml").write_text('name = "two"\nmembers = ["lda", "svm-spectra"]')
    is_new, new = own.y == own.materials[-1], own.materials[-1]
    old = [at for at in train if not is_new[at]]
    few = [at for at in train if is_new[at]][:4]
    committee = tactnet.TactNetCommittee(recipe=tmp_path / "two.toml", rate=own.rate)
    grown = committee.fit(own.X[old], own.y[old]).enroll(own.X[few], new, own.X[old], own.y[old])
    assert grown.classes_.tolist() == [*committee.classes_, new]
    assert len(committee.classes_) == len(own.materials) - 1
    again = tactnet.TactNetCommittee(recipe=tmp_path / "two.toml", rate=own.rate).fit(own.X[[*old, *few]], own.y[[*old, *few]])
    order = [again.classes_.tolist().index(name) for name in grown.classes_]
    assert np.abs(grown.predict_proba(own.X[test]) - again.predict_proba(own.X[test])[:, order]).max() < 1e-9
    with pytest.warns(UserWarning, match="lacks `svm-spectra`"):
        committee.enroll(own.X[few[:1]], new, own.X[old], own.y[old])
    with pytest.raises(tactnet.TactnetError, match="knows a material of this name"):
        committee.enroll(own.X[few], own.materials[0], own.X[old], own.y[old])


def test_frame_by_frame_is_the_whole_sweep(data, network):
    own, _, _, test = data
    online = network.online()
    whole = network.predict_log_proba(own.X[test[:3]])
    for sweep, log_p in zip(own.X[test[:3]], whole):
        online.begin()
        for frame in sweep:
            online.push(frame)
        assert online.is_complete
        assert np.abs(online.predict_proba(dropout=True) - np.exp(log_p)).max() < 1e-3
        fused = online.fuse()
    assert np.abs(fused - tactnet.fuse(whole)).max() < 1e-2
    with pytest.raises(tactnet.TactnetError, match="begin"):
        online.push(sweep[0])


def test_without_scikit_learn(data, tmp_path):
    program = f"""
import sys
sys.modules["sklearn"] = None
import tactnet
own = tactnet.Dataset.read({str(data[1])!r})
fitted = tactnet.KnnClassifier(rate=750, features="l").fit(own.X, own.y)
assert fitted.get_params() == {{"features": "l", "rate": 750, "shape": None, "seed": 1, "random_state": None}}, fitted.get_params()
print(fitted.score(own.X, own.y))
"""
    found = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout
    assert float(found) > 0.5


@pytest.fixture
def robot(network, tmp_path):
    """Starts a hub in this process, and a classifier and a recorder as processes."""
    network.save(tmp_path / "run")
    table = tmp_path / "robot.toml"
    processes = []
    from tactnet import channel

    with channel.Hub(bus=f"python{os.getpid()}") as hub:
        table.write_text(hub.table)
        for arguments in (
            ["serve", "--run", tmp_path / "run", "--table", table],
            ["record", "--table", table, "--out", tmp_path / "day.mcap"],
        ):
            process = subprocess.Popen([TACTNET, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
            assert process.stdout.readline() == b"ready\n"
            processes.append(process)
        yield channel.Bus(str(table)), processes, tmp_path / "day.mcap"
        for process in processes:
            process.terminate()
            process.wait()


def test_frames_go_in_and_beliefs_come_out(data, network, robot):
    own, _, _, test = data
    bus, processes, file = robot
    skin, commands, beliefs = bus.skin(), bus.commands(), bus.beliefs()
    assert bus.fingers == ["skin/right"]
    assert beliefs.get(timeout=0.05) is None
    sweep = own.X[test[0]]
    # One second of rest, in which the service connects to the new ports; the 250 frames of a motion that the table skips; the sweep; some
    # more frames.
    frames = np.concatenate([np.zeros((1000, 4, 4)), sweep, np.zeros((30, 4, 4))])
    begun, first = time.monotonic(), time.time_ns()
    for number, frame in enumerate(frames):
        if number == 750:
            commands.start(motion=7, material="cork")
        skin.put(frame, sensor_time_ns=first + number * 10**9 // 750)
        time.sleep(max(0.0, begun + (number + 1) / 750 - time.monotonic()))
    commands.stop(motion=7)

    async def last():
        found = None
        async for belief in beliefs:
            found = belief
            if belief["stage"] == "dropout":
                return found

    belief = asyncio.run(asyncio.wait_for(last(), 20))
    assert belief["motion"] == 7 and belief["materials"] == network.classes_.tolist()
    assert np.abs(np.array(belief["posterior"]) - network.predict_proba(sweep[None])[0]).max() < 1e-3
    assert belief["sweep_says"]["material"] == network.predict(sweep[None])[0]
    processes[1].terminate()
    processes[1].wait()

    recording = tactnet.Recording(file)
    assert recording.cut is None and recording.fingers == ["skin/right"]
    frames = recording.frames()
    known = frames["sequence"] >= 1000
    assert frames["sequence"][known].tolist() == list(range(1000, 1330))
    assert (frames["digits"][known][:300] == sweep.reshape(300, 16)).all()
    assert recording.beliefs()[-1]["posterior"] == belief["posterior"]
    senders = {(packet.channel, packet.sender) for packet in recording.packets()}
    assert all(sender is not None for _, sender in senders) and len({sender for _, sender in senders}) == len(senders)
    sweeps = recording.sweeps()
    assert sweeps.y.tolist() == ["cork"] and (sweeps.X[0] == sweep).all()
    pandas = pytest.importorskip("pandas")
    table = pandas.json_normalize(recording.beliefs())
    assert table["sweep_says.material"].iloc[-1] == belief["sweep_says"]["material"]


def test_folds_are_as_many_as_asked_for(data):
    own = data[0]
    assert len(own.folds(folds=3)) == len(own.folds("k-fold", folds=3)) == 3
    assert len(own.folds()) == 5
    for wrong, complaint in [((3,), "folds=3"), (("leave-block-out", 3), "expected None")]:
        with pytest.raises(tactnet.TactnetError, match=complaint):
            own.folds(*wrong)


def test_probabilities_are_not_taken_for_logarithms():
    probabilities = np.array([[0.7, 0.2, 0.1], [0.6, 0.3, 0.1]])
    with pytest.raises(tactnet.TactnetError, match="np.log"):
        tactnet.fuse(probabilities)
    assert np.allclose(tactnet.fuse(np.empty((0, 3))), 1 / 3)
    expected = probabilities.prod(axis=0) / probabilities.prod(axis=0).sum()
    assert np.allclose(tactnet.fuse(np.log(probabilities)), expected)


def test_a_folder_is_opened_by_the_class_of_its_classifier(data, tmp_path):
    own, _, train, test = data
    for number, fitted in enumerate([tactnet.LdaClassifier(rate=750), tactnet.KnnClassifier(features="l", rate=750)]):
        fitted.fit(own.X[train], own.y[train]).save(tmp_path / str(number))
        loaded = type(fitted).load(tmp_path / str(number))
        assert loaded.get_params() == fitted.get_params()
        assert (loaded.predict(own.X[test]) == fitted.predict(own.X[test])).all()
        with pytest.raises(tactnet.TactnetError, match=f"use {type(fitted).__name__}.load"):
            tactnet.TactNetClassifier.load(tmp_path / str(number))


def test_a_folder_of_any_class_is_opened_by_the_base_class(data, tmp_path):
    own, _, train, test = data
    lda = tactnet.LdaClassifier(rate=750).fit(own.X[train], own.y[train])
    lda.save(tmp_path / "lda")
    loaded = tactnet.SweepClassifier.load(tmp_path / "lda")
    assert type(loaded) is tactnet.LdaClassifier
    assert (loaded.predict(own.X[test]) == lda.predict(own.X[test])).all()

    class Means(tactnet.SweepClassifier):
        def _recipe(self):
            return "means"

    means = Means(rate=750).fit(own.X[train], own.y[train])
    means.save(tmp_path / "means")
    loaded = tactnet.SweepClassifier.load(tmp_path / "means")
    assert type(loaded) is tactnet.SweepClassifier
    assert (loaded.predict(own.X[test]) == means.predict(own.X[test])).all()
    with pytest.raises(tactnet.TactnetError, match="found means; use SweepClassifier.load"):
        tactnet.LdaClassifier.load(tmp_path / "means")


def test_errors_speak_of_python(data, tmp_path):
    own, _, train, test = data
    with pytest.raises(tactnet.TactnetError, match="^epochs: expected at least 1, found 0$"):
        tactnet.TactNetClassifier(rate=750, epochs=0).fit(own.X[train], own.y[train])
    fitted = tactnet.LdaClassifier(rate=750).fit(own.X[train], own.y[train])
    (tmp_path / "empty").mkdir()
    fitted.save(tmp_path / "empty")
    with pytest.raises(tactnet.TactnetError, match="expected a new or an empty folder, found files") as refused:
        fitted.save(str(tmp_path / "empty"))
    assert "--" not in str(refused.value) and str(tmp_path / "empty") in str(refused.value)
    with pytest.raises(tactnet.TactnetError, match="name a folder that `save` of a classifier"):
        tactnet.LdaClassifier.load(tmp_path / "nothing")
    for name in ("X", "samples"):
        file = tmp_path / f"{name}.npz"
        np.savez(file, **{name: own.X[test]})
        with pytest.raises(tactnet.TactnetError, match="`predict` of a classifier takes arrays without materials") as refused:
            tactnet.Dataset.read(file)
        assert "tactnet predict" not in str(refused.value) and f"`{name}`" in str(refused.value)
        assert (fitted.predict(np.load(file)[name]) == fitted.predict(own.X[test])).all()


def test_sweeps_without_materials_come_from_any_file(data, tmp_path):
    own, _, train, test = data
    fitted = tactnet.LdaClassifier(rate=750).fit(own.X[train], own.y[train])
    np.savez(tmp_path / "new.npz", X=own.X[test])
    sweeps = tactnet.read_sweeps(tmp_path / "new.npz", rate=750)
    assert (sweeps.X == own.X[test]).all() and sweeps.X.dtype == own.X.dtype
    assert sweeps.rate == 750 and not sweeps.rate_is_assumed and sweeps.names[:2] == ["0", "1"]
    assert (fitted.predict(sweeps.X) == fitted.predict(own.X[test])).all()
    folder = tmp_path / "folder"
    folder.mkdir()
    for name, index in (("b", 0), ("a", 1)):
        np.savetxt(folder / f"{name}.csv", own.X[index].reshape(own.X.shape[1], -1), fmt="%d", delimiter=",")
    sweeps = tactnet.read_sweeps(folder, steps=50)
    assert sweeps.names == ["a", "b"] and sweeps.rate_is_assumed
    assert (sweeps.X.reshape(2, 50, -1) == own.X[[1, 0], :50].reshape(2, 50, -1)).all()
    # It also reads a labelled data set.
    own.write(tmp_path / "own.h5")
    assert (tactnet.read_sweeps(tmp_path / "own.h5").X == tactnet.Dataset.read(tmp_path / "own.h5").X).all()


def test_training_sweeps_are_checked(data):
    own, _, train, _ = data
    X, y = own.X[train], own.y[train]
    still = X.copy()
    still[5] = still[5, 0]
    with pytest.raises(tactnet.TactnetError, match=r"^X\[5\], .* no taxel ever changes$"):
        tactnet.LdaClassifier(rate=750).fit(still, y)
    # A bootstrap sample repeats sweeps.
    again = np.r_[0 : len(X), 0, 1]
    with pytest.warns(UserWarning, match="has the same values as") as told:
        tactnet.LdaClassifier(rate=750).fit(X[again], y[again])
    assert len(told) == 1 and told[0].filename == __file__
    # With two sweeps per material, a fold leaves one for training.
    kept = np.delete(np.arange(len(X)), np.flatnonzero(y == y[0])[1:])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tactnet.LdaClassifier(rate=750).fit(X[kept], y[kept])


def test_no_sweeps_are_no_gaps(data):
    own, _, train, _ = data
    fitted = tactnet.LdaClassifier(rate=750).fit(own.X[train], own.y[train])
    with pytest.raises(ValueError, match="0 sample"):
        fitted.predict(own.X[:0].astype(float))


def test_continuous_recordings_are_cut_into_windows(tmp_path):
    file = tmp_path / "stream.csv"
    rows = [f"{frame},{frame % 5},{'cork' if frame < 70 else 'felt'}" for frame in range(150)]
    file.write_text("a,b,label\n" + "\n".join(rows) + "\n")
    data = tactnet.Dataset.read(file, rate=20, window=1.0, hop="500ms")
    assert data.X.shape == (6 + 7, 20, 1, 2)
    assert list(data.X[:, 0, 0, 0][:2]) == [0, 10]
    assert tactnet.Dataset.read(file, rate=20, window=20, columns=["a"]).X.shape == (3 + 4, 20, 1, 1)
    with pytest.raises(tactnet.TactnetError, match="window="):
        tactnet.Dataset.read(file)
    with pytest.warns(UserWarning, match="the named 100 Hz takes precedence"):
        tactnet.Dataset.from_arrays(data.X, data.y, rate=20).write(tmp_path / "own.npz")
        tactnet.Dataset.read(tmp_path / "own.npz", rate=100)


def test_arrays_in_groups_and_of_matlab_are_read():
    foreign = HERE.parents[2] / "tests/fixtures/foreign"
    sweep, step, taxel = np.ogrid[:6, :12, :4]
    expected = (37 * sweep + 5 * step + taxel) % 251
    own = tactnet.Dataset.read(foreign / "groups.h5", samples="recorded/skin/pressure", labels="recorded/material")
    assert (own.X[:, :, 0] == expected).all() and own.rate == 250
    assert list(own.y) == ["cork", "denim", "felt"] * 2
    with pytest.raises(tactnet.TactnetError, match="recorded/half.*pass `samples=`"):
        tactnet.Dataset.read(foreign / "groups.h5")
    assert (tactnet.Dataset.read(foreign / "v73_cell.mat").X == own.X).all()


def test_gaps_and_transposed_sweeps_are_told(data):
    own, _, train, test = data
    X = own.X[train].astype(np.float32)
    fitted = tactnet.LdaClassifier(rate=750).fit(X, own.y[train])
    X[3, 7] = np.nan
    for use in [lambda: fitted.predict(X), lambda: fitted.fit(X, own.y[train])]:
        with pytest.raises(tactnet.TactnetError) as refused:
            use()
        assert "1 of 48 sweeps, the first X[3]" in str(refused.value) and "\n" not in str(refused.value)
    turned = own.X[train].reshape(len(train), 300, 16).transpose(0, 2, 1)
    with pytest.warns(UserWarning, match="axes are in another order"):
        tactnet.LdaClassifier(rate=750).fit(turned, own.y[train])


def test_sweeps_unlike_the_training_data_are_told(data):
    own, _, train, test = data
    classifier = tactnet.LdaClassifier(rate=own.rate).fit(own.X[train], own.y[train])
    like, unlike = classifier.likeness(own.X[test]), classifier.likeness(-own.X[test].astype("float32"))
    assert like["verdict"] == "like" and len(like["p_of_sweeps"]) == len(test)
    assert unlike["verdict"] == "unlike" and unlike["differences"][0]["kind"] == "sign"


def test_lists_of_sweeps_of_unequal_length_are_learnt_and_predicted(data, tmp_path):
    own, _, train, test = data
    lengths = 150 + np.random.default_rng(3).integers(0, 151, len(own.y))
    sweeps = [sweep[:steps] for sweep, steps in zip(own.X, lengths)]
    part = lambda indices: [sweeps[index] for index in indices]
    for classifier in [tactnet.LdaClassifier(rate=own.rate), tactnet.TactNetClassifier(rate=own.rate, recipe="spectra", epochs=3)]:
        classifier.fit(part(train), own.y[train])
        found = classifier.predict_log_proba(part(test))
        # One sweep at a time, and in another order: the same numbers.
        assert (classifier.predict_log_proba([sweeps[test[2]]]) == found[2]).all()
        assert (classifier.predict_log_proba(part(test[::-1])) == found[::-1]).all()
        assert classifier.predict(own.X[test]).shape == (len(test),), "whole sweeps, all longer than some training sweeps"
    unequal = tactnet.Dataset.from_arrays(sweeps, own.y, rate=own.rate)
    assert (unequal.lengths == lengths).all() and own.lengths is None
    unequal.write(tmp_path / "unequal.npz")
    again = tactnet.Dataset.read(tmp_path / "unequal.npz")
    assert again.sha256 == unequal.sha256
    X = tactnet.read_sweeps(tmp_path / "unequal.npz").X
    assert [sweep.shape for sweep in X] == [sweep.shape for sweep in sweeps]
    whole = tactnet.LdaClassifier(rate=own.rate).fit(own.X[train], own.y[train])
    with pytest.raises(tactnet.TactnetError, match="at least 300 steps, as all training sweeps"):
        whole.predict(part(test))
    with pytest.raises(tactnet.TactnetError, match=r"X\[1\]: expected at least one frame of the taxels of X\[0\]"):
        whole.predict([np.zeros((10, 16)), np.zeros((20, 15))])
