"""Tests of estimators in other people's programs: failed fits, forks, input, weights, scikit-learn's tools."""

import io
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time
import warnings

import numpy as np
import pytest
import tactnet


@pytest.fixture(scope="module")
def data():
    return tactnet.Dataset.twin(materials=3, sweeps=12, steps=200)


class Stopped(Exception):
    """An exception of a callback."""


class Interrupted(tactnet.TactNetClassifier):
    """A network whose training is stopped at its first batch."""

    def _progress(self):
        def stop(*_):
            raise Stopped

        return stop if self.epochs == 2 else None


def fitted_state(estimator):
    return {name: id(value) for name, value in vars(estimator).items()}


def test_a_fit_that_fails_or_is_interrupted_leaves_the_estimator_as_it_was(data, tmp_path):
    (tmp_path / "two.toml").write_text('name = "two"\nmembers = ["lda", "svm-spectra"]')
    X, y = data.X, data.y
    others = np.where(y == y[0], "zinc", "aluminium")
    short = data.X[:, :3]
    for estimator, breaks in [
        (tactnet.LdaClassifier(rate=750), lambda lda: lda.fit(np.full_like(X, 7), others)),
        (tactnet.SvmClassifier(rate=750), lambda svm: svm.fit(short, others)),
        (tactnet.KnnClassifier(rate=750), lambda knn: knn.fit(short, others)),
        (tactnet.TactNetCommittee(recipe=tmp_path / "two.toml", rate=750), lambda of: of.fit(X, others, sample_weight=np.arange(1, len(y) + 1))),
        (Interrupted(rate=750, epochs=1), lambda network: network.set_params(epochs=2).fit(X[:, :100], others)),
    ]:
        expected = estimator.fit(X, y).predict(X[:5])
        state = fitted_state(estimator)
        with pytest.raises((Stopped, ValueError)):
            breaks(estimator)
        kept = fitted_state(estimator)
        state.pop("epochs", None), kept.pop("epochs", None)
        assert kept == state, type(estimator).__name__
        assert (estimator.predict(X[:5]) == expected).all() and "zinc" not in estimator.classes_


def test_a_failed_enrolment_or_adaptation_leaves_the_estimator_as_it_was(data):
    known = data.y != data.materials[0]
    network = tactnet.TactNetClassifier(rate=750, epochs=1).fit(data.X[known], data.y[known])
    state = fitted_state(network)
    for fails in [
        lambda: network.enroll(data.X[:3, :50], "felt"),
        lambda: network.enroll(data.X[:3], network.classes_[0]),
        lambda: network.adapt(data.X[:2]),
    ]:
        with pytest.raises(tactnet.TactnetError):
            fails()
        assert fitted_state(network) == state
    grown = network.enroll(data.X[~known][:4], "felt")
    assert fitted_state(network) == state and list(grown.classes_) == [*network.classes_, "felt"]


def test_ctrl_c_stops_a_training_and_leaves_the_estimator_as_it_was(data):
    network = tactnet.TactNetClassifier(rate=750, epochs=1).fit(data.X, data.y)
    state = fitted_state(network)
    network.epochs = 100_000
    # A background job of a shell starts with this signal ignored.
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Timer(1.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        network.fit(data.X[:, :150], np.where(data.y == data.y[0], "a", "b"))
    # A batch takes a fraction of a second; the limit is for busy machines.
    assert time.monotonic() - begun < 60
    signal.signal(signal.SIGINT, former)
    network.epochs = 1
    assert {**fitted_state(network), "epochs": 0} == {**state, "epochs": 0}


def run_forked(program: str) -> str:
    """Runs a program that forks; a hang ends after two minutes with an error."""
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_fork_after_use_works_in_the_children():
    program = """
        import multiprocessing, numpy as np, tactnet
        data = tactnet.Dataset.twin(materials=3, sweeps=8, steps=150)
        rocket = tactnet.MiniRocketClassifier(rate=750).fit(data.X, data.y)
        network = tactnet.TactNetClassifier(rate=750, epochs=1).fit(data.X, data.y)
        expected = rocket.predict(data.X), network.predict(data.X)

        def child(number):
            lda = tactnet.LdaClassifier(rate=750).fit(data.X, data.y)
            again = tactnet.TactNetClassifier(rate=750, epochs=1).fit(data.X, data.y)
            checks = len(data.check())
            same = (rocket.predict(data.X) == expected[0]).all() and (network.predict(data.X) == expected[1]).all()
            return bool(same and (again.predict(data.X) == expected[1]).all()), checks

        with multiprocessing.get_context("fork").Pool(2) as pool:
            found = pool.map(child, range(4))
        assert all(same for same, _ in found), found
        # The parent goes on.
        assert (network.predict(data.X) == expected[1]).all()
        print("done")
    """
    assert run_forked(program) == "done\n"


def test_fork_during_a_training_is_refused_in_the_child():
    program = """
        import multiprocessing, threading, time, tactnet
        data = tactnet.Dataset.twin(materials=3, sweeps=8, steps=150)
        begun, stop = threading.Event(), threading.Event()

        class Watched(tactnet.TactNetClassifier):
            def _progress(self):
                def watch(*_):
                    begun.set()
                    if stop.is_set():
                        raise KeyboardInterrupt
                return watch

        def train():
            try:
                Watched(rate=750, epochs=100000).fit(data.X, data.y)
            except KeyboardInterrupt:
                pass

        def child(answers):
            try:
                data.check()
                answers.put("worked")
            except tactnet.TactnetError as refused:
                answers.put(str(refused))

        thread = threading.Thread(target=train)
        thread.start()
        begun.wait()
        context = multiprocessing.get_context("fork")
        answers = context.Queue()
        process = context.Process(target=child, args=(answers,))
        process.start()
        print(answers.get(timeout=60))
        process.join()
        stop.set()
        thread.join()
    """
    told = run_forked(program)
    assert "was forked while another thread used tactnet" in told and 'get_context("spawn")' in told


def test_ports_of_a_parent_are_refused_in_a_forked_child_which_can_open_its_own():
    program = f"""
        import multiprocessing, os, tactnet
        from tactnet import channel, packets

        with channel.Hub(bus="fork{os.getpid()}") as hub:
            bus = channel.Bus(hub.table)
            commands, got = bus.commands(), bus.get_port("sweep/command", packets.SweepCommand)
            told = []

            def child(answers, may_end):
                for use in (commands.stop, lambda: got.get(timeout=0.1), bus.skin, hub.stop):
                    try:
                        use()
                        answers.put("worked")
                    except tactnet.TactnetError as refused:
                        answers.put(str(refused))
                with channel.Bus(hub.table) as own, own.commands() as port:
                    port.stop(motion=9)
                    answers.put("own")
                    may_end.wait(60)

            context = multiprocessing.get_context("fork")
            answers, may_end = context.Queue(), context.Event()
            process = context.Process(target=child, args=(answers, may_end))
            process.start()
            refusals = [answers.get(timeout=60) for _ in range(4)]
            assert all("was forked" in text and "spawn" in text for text in refusals), refusals
            assert answers.get(timeout=60) == "own"
            # The parent's ports still work, and have the child's packet.
            assert got.get(timeout=5).motion == 9
            may_end.set()
            process.join()
            assert process.exitcode == 0
            commands.stop(motion=4)
            assert got.get(timeout=5).motion == 4
        print("done")
    """
    assert run_forked(program) == "done\n"


def test_single_sweeps_and_tables_get_advice(data):
    lda = tactnet.LdaClassifier(rate=750)
    lda.fit(data.X, data.y)
    sweep = data.X[0].reshape(200, 16)
    for refused in [lambda: lda.predict(sweep), lambda: lda.fit(sweep, data.y), lambda: tactnet.Dataset.from_arrays(sweep, data.y)]:
        with pytest.raises(tactnet.TactnetError) as told:
            refused()
        assert "use `X[None]`" in str(told.value) and "`shape=(steps, taxels)`" in str(told.value)
    assert lda.predict(sweep[None]).shape == (1,)
    flat = data.X.reshape(len(data), -1)
    tables = [flat]
    try:
        import pandas

        tables.append(pandas.DataFrame(flat, columns=[f"t{at}" for at in range(flat.shape[1])]))
    except ImportError:
        pass
    for table in tables:
        with pytest.raises(tactnet.TactnetError, match=r"pass `shape=\(steps, taxels\)`"):
            tactnet.LdaClassifier(rate=750).fit(table, data.y)
        of_table = tactnet.LdaClassifier(rate=750, shape=(200, 4, 4)).fit(table, data.y)
        assert (of_table.predict_log_proba(table) == lda.predict_log_proba(data.X)).all()
        assert (of_table.predict_log_proba(data.X) == lda.predict_log_proba(data.X)).all()
        assert of_table.n_features_in_ == lda.n_features_in_ == 200 * 16
        same = tactnet.Dataset.from_arrays(table, data.y, rate=750, shape=(200, 4, 4))
        assert (same.X == data.X).all()
    with pytest.raises(tactnet.TactnetError, match="rows of 30 values"):
        tactnet.LdaClassifier(rate=750, shape=(10, 3)).fit(flat, data.y)


def test_odd_labels_and_masks_are_refused_by_name(data):
    lda = tactnet.LdaClassifier(rate=750)
    masked = np.ma.masked_array(data.X, mask=data.X == 0)
    missing = data.y.astype(object)
    missing[4] = None
    for X, y, complaint in [
        (masked, data.y, "X: expected an array without a mask"),
        ([*masked[:2], *data.X[2:]], data.y, r"X\[0\]: expected an array without a mask"),
        (None, data.y, "X: .*found None"),
        (data.X, np.char.encode(data.y), "y: .*found bytes.*np.char.decode"),
        (data.X, missing, r"y\[4\]: expected a material, found None"),
        (data.X, np.ma.masked_array(np.arange(len(data)) % 3, mask=[True] * len(data)), "y: expected an array without a mask"),
    ]:
        for use in (lambda: lda.fit(X, y), lambda: tactnet.Dataset.from_arrays(X, y)):
            with pytest.raises(tactnet.TactnetError, match=complaint):
                use()
    lda.fit(data.X, data.y)
    with pytest.raises(tactnet.TactnetError, match="mask"):
        lda.predict(masked)


@pytest.mark.parametrize("labels", [np.array([10, 2, 300]), np.array([0, 1, 2], np.uint8), np.array([1.0, 2.0, 5.0])])
def test_numbers_come_back_as_numbers_after_save_and_load(data, labels, tmp_path):
    y = labels[data._native.labels]
    lda = tactnet.LdaClassifier(rate=750).fit(data.X, y)
    lda.save(tmp_path / "saved")
    again = tactnet.SweepClassifier.load(tmp_path / "saved")
    assert again.classes_.dtype == labels.dtype and (again.classes_ == np.unique(labels)).all()
    assert (again.predict(data.X) == lda.predict(data.X)).all() and again.score(data.X, y) == lda.score(data.X, y)
    assert again.n_features_in_ == lda.n_features_in_ == 200 * 16
    named = tactnet.LdaClassifier(rate=750).fit(data.X, data.y)
    named.save(tmp_path / "named")
    assert (tactnet.LdaClassifier.load(tmp_path / "named").classes_ == named.classes_).all()


WEIGHTED = [
    tactnet.LdaClassifier(rate=750),
    tactnet.MiniRocketClassifier(rate=750),
    tactnet.TactNetClassifier(rate=750, recipe="spectra", epochs=20),
]


@pytest.mark.parametrize("estimator", WEIGHTED, ids=lambda of: type(of).__name__)
def test_weights_move_the_fit_and_zeros_leave_sweeps_out(data, estimator):
    from sklearn.base import clone

    X, y = data.X, data.y
    plain = clone(estimator).fit(X, y)
    constant = clone(estimator).fit(X, y, sample_weight=np.full(len(y), 0.25))
    assert (constant.predict_log_proba(X) == plain.predict_log_proba(X)).all()
    used = np.arange(len(y)) % 4 > 0
    zeros = clone(estimator).fit(X, y, sample_weight=used.astype(float))
    assert (zeros.predict_log_proba(X) == clone(estimator).fit(X[used], y[used]).predict_log_proba(X)).all()
    # A material that weighs more gets more probability on doubtful sweeps.
    heavy = clone(estimator).set_params(class_weight={data.materials[1]: 50.0}).fit(X, y)
    doubtful = (X[y == data.materials[0]].astype(float) + X[y == data.materials[1]]) / 2
    column = list(plain.classes_).index(data.materials[1])
    assert heavy.predict_proba(doubtful)[:, column].mean() > plain.predict_proba(doubtful)[:, column].mean()
    same = clone(estimator).fit(X, y, sample_weight=np.where(y == data.materials[1], 50.0, 1.0))
    assert (same.predict_log_proba(X) == heavy.predict_log_proba(X)).all()


def test_balanced_weights_are_those_of_scikit_learn(data):
    from sklearn.utils.class_weight import compute_sample_weight

    kept = np.r_[0:12, 12:18, 24:27]
    X, y = data.X[kept], data.y[kept]
    balanced = tactnet.LdaClassifier(rate=750, class_weight="balanced").fit(X, y)
    weights = compute_sample_weight("balanced", y)
    assert (balanced.predict_log_proba(X) == tactnet.LdaClassifier(rate=750).fit(X, y, weights).predict_log_proba(X)).all()
    # Of equal numbers it is no change.
    equal = tactnet.LdaClassifier(rate=750, class_weight="balanced").fit(data.X, data.y)
    assert (equal.predict_log_proba(X) == tactnet.LdaClassifier(rate=750).fit(data.X, data.y).predict_log_proba(X)).all()


def test_weights_are_refused_by_name_where_a_model_cannot_use_them(data):
    weights = np.linspace(1, 2, len(data))
    for estimator in (tactnet.KnnClassifier(), tactnet.SvmClassifier(), tactnet.QuantClassifier()):
        name = type(estimator).__name__
        with pytest.raises(tactnet.TactnetError, match=f"sample_weight: {name} cannot weigh sweeps; TactNetClassifier"):
            estimator.fit(data.X, data.y, sample_weight=weights)
        with pytest.raises(TypeError, match="groups"):
            estimator.fit(data.X, data.y, groups=weights)
        with pytest.raises(TypeError):
            type(estimator)(class_weight="balanced")
    with pytest.raises(tactnet.TactnetError, match="model `svm-spectra` cannot use sample weights"):
        tactnet.TactNetCommittee(rate=750, epochs=1).fit(data.X, data.y, weights)
    lda = tactnet.LdaClassifier(rate=750)
    for wrong, complaint in [(weights[1:], "one for each of 36 sweeps"), (-weights, "numbers from 0"), (weights * np.nan, "numbers from 0")]:
        with pytest.raises(tactnet.TactnetError, match=complaint):
            lda.fit(data.X, data.y, wrong)
    for wrong in ("balance", {data.materials[0]: 1.0, "felt?": 2.0}, {data.materials[0]: -1.0}):
        with pytest.raises(tactnet.TactnetError, match="class_weight: expected"):
            tactnet.LdaClassifier(rate=750, class_weight=wrong).fit(data.X, data.y)


def test_random_state_is_the_seed(data):
    from sklearn.ensemble import BaggingClassifier

    of = lambda **settings: tactnet.MiniRocketClassifier(rate=750, **settings).fit(data.X, data.y).predict_log_proba(data.X)
    assert (of(random_state=7) == of(seed=7)).all() and (of(random_state=7) != of(random_state=8)).any()
    drawn = [of(random_state=np.random.RandomState(3)), of(random_state=np.random.RandomState(3)), of(random_state=np.random.default_rng(3))]
    assert (drawn[0] == drawn[1]).all() and (drawn[0] != drawn[2]).any()
    with pytest.raises(tactnet.TactnetError, match="random_state: expected"):
        of(random_state=-1)
    table = data.X.reshape(len(data), -1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        bag = BaggingClassifier(tactnet.LdaClassifier(rate=750, shape=(200, 16)), n_estimators=3, random_state=1).fit(table, data.y)
    assert len({member.random_state for member in bag.estimators_}) == 3 and bag.score(table, data.y) > 0.5


def test_decision_functions_agree_with_predictions(data):
    lda = tactnet.LdaClassifier(rate=750).fit(data.X, data.y)
    assert (lda.classes_[lda.decision_function(data.X).argmax(axis=1)] == lda.predict(data.X)).all()
    two = data.y != data.materials[0]
    binary = tactnet.LdaClassifier(rate=750).fit(data.X[two], data.y[two])
    decisions = binary.decision_function(data.X)
    assert decisions.shape == (len(data),)
    assert (binary.classes_[(decisions > 0).astype(int)] == binary.predict(data.X)).all()
    assert np.allclose(1 / (1 + np.exp(-decisions)), binary.predict_proba(data.X)[:, 1])


def test_groups_stay_together(data):
    from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score

    blocks = np.arange(len(data)) % 4
    own = tactnet.Dataset.from_arrays(data.X, data.y, rate=750, blocks=blocks)
    lda = tactnet.LdaClassifier(rate=750)
    scores = cross_val_score(lda, own.X, own.y, groups=own.blocks, cv=GroupKFold(4))
    assert len(scores) == 4 and scores.mean() > 0.5
    search = GridSearchCV(tactnet.KnnClassifier(rate=750), {"features": ["h", "l"]}, cv=GroupKFold(2))
    assert search.fit(own.X, own.y, groups=own.blocks).best_score_ > 0.3
    folds = own.folds("group-k-fold", folds=4)
    assert len(folds) == 4
    for train, test in folds:
        assert not set(blocks[train]) & set(blocks[test]) and len(test)
    named = tactnet.Dataset.from_arrays(data.X, data.y, rate=750, blocks=np.array(["mon", "tue", "wed", "thu"])[blocks])
    assert len(named.folds("group-k-fold")) == 4, "as many folds as blocks"
    for train, test in named.folds(folds=2):
        assert not set(blocks[train]) & set(blocks[test]), "the default scheme holds out whole blocks"
    with pytest.raises(tactnet.TactnetError, match="blocks: expected a name or a whole number"):
        tactnet.Dataset.from_arrays(data.X, data.y, rate=750, blocks=[0.5] * len(data))


def test_learning_curves_begin_with_few_sweeps(data):
    from sklearn.model_selection import StratifiedKFold, learning_curve

    cv = list(StratifiedKFold(2, shuffle=True, random_state=1).split(data.X, data.y))[:1]
    # Five sweeps leave materials with a single one, which no inner split can hold out. A covariance needs more.
    for estimator, smallest in [
        (tactnet.MiniRocketClassifier(rate=750), 5),
        (tactnet.QuantClassifier(rate=750), 5),
        (tactnet.SvmClassifier(rate=750), 5),
        (tactnet.LdaClassifier(rate=750), 12),
    ]:
        sizes, train, test = learning_curve(
            estimator, data.X, data.y, cv=cv, train_sizes=[smallest], shuffle=True, random_state=2, error_score="raise"
        )
        assert list(sizes) == [smallest] and np.isfinite(test).all(), type(estimator).__name__


def test_the_progress_bar_has_a_total_and_closes(data, monkeypatch, tmp_path):
    tqdm = pytest.importorskip("tqdm.auto")
    bars = []

    class Bar(tqdm.tqdm):
        def __init__(self, *arguments, **settings):
            bars.append(self)
            self.totals, self.closed = [settings["total"]], 0
            super().__init__(*arguments, file=io.StringIO(), **settings)

        def reset(self, total=None):
            self.totals.append(total)
            super().reset(total)

        def close(self):
            self.closed += 1
            super().close()

    monkeypatch.setattr(tqdm, "tqdm", Bar)
    network = tactnet.TactNetClassifier(rate=750, recipe="spectra", epochs=3, progress=True).fit(data.X, data.y)
    (bar,) = bars
    assert bar.n == bar.total == bar.totals[0] > 0 and bar.closed
    # A committee's networks follow one another.
    recipe = tmp_path / "two.toml"
    recipe.write_text('name = "two"\nmembers = ["spectra", "lda", "fast"]')
    tactnet.TactNetCommittee(recipe=recipe, rate=750, epochs=2, progress=True).fit(data.X, data.y)
    assert len(bars) == 2 and len(bars[1].totals) == 2 and bars[1].n == bars[1].total and bars[1].closed
    # It closes after an exception, too.
    monkeypatch.setattr(Bar, "update", lambda self: (_ for _ in ()).throw(Stopped))
    with pytest.raises(Stopped):
        network.fit(data.X, data.y)
    assert bars[2].closed


def test_without_tqdm_there_is_a_line_an_epoch(data, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    tactnet.TactNetClassifier(rate=750, recipe="spectra", epochs=2, progress=True).fit(data.X, data.y)
    lines = capsys.readouterr().out.strip().splitlines()
    assert len(lines) == 2 and lines[1].startswith("epoch 2/2: loss")


def test_data_sets_are_pickled_indexed_and_iterated(data):
    lengths = 150 + np.arange(len(data)) % 40
    X = [sweep[:steps].astype(np.float32) / 3 for sweep, steps in zip(data.X, lengths)]
    X[5][3, 1, 1] = np.nan
    for own in (
        data,
        tactnet.Dataset.from_arrays(X, data.y, blocks=np.arange(len(data)) % 3, name="a/b"),
    ):
        again = pickle.loads(pickle.dumps(own))
        assert again.sha256 == own.sha256 and repr(again) == repr(own)
        assert (again.rate, again.rate_is_assumed, again.materials) == (own.rate, own.rate_is_assumed, own.materials)
        assert (again.blocks is None) == (own.blocks is None)
        pairs = list(own)
        assert len(pairs) == len(own) and [material for _, material in pairs] == own.y.tolist()
        assert np.array_equal(own[-1][0], pairs[-1][0], equal_nan=True) and own[3][1] == own.y[3]
        part = own[own.y != own.materials[0]]
        assert part.materials == own.materials[1:] and len(part) == 24 and part.rate == own.rate
        assert np.array_equal(part[0][0], pairs[12][0], equal_nan=True)
        assert len(own[::5]) == 8 and own[[4, 4, 0]].y.tolist() == [own.y[4], own.y[4], own.y[0]]
        for wrong in (len(own), -len(own) - 1):
            with pytest.raises(IndexError):
                own[wrong]
    assert [len(sweep) for sweep, _ in own] == lengths.tolist()


def test_ports_close_and_packets_have_sender_and_time():
    from tactnet import channel, packets

    with channel.Hub(bus=f"closing{os.getpid()}") as hub:
        with channel.Bus(hub.table) as bus:
            with bus.commands() as commands, bus.get_port("sweep/command", packets.SweepCommand) as port:
                before = time.monotonic_ns()
                commands.start(motion=3, material="x" * 56)
                packet = port.get(timeout=5)
                assert packet.material == "x" * 56 and before <= packet.put_ns <= time.monotonic_ns()
                with bus.put_port("sweep/command", packets.SweepCommand) as other:
                    other.put(packets.SweepCommand(kind=packets.Command.STOP))
                    second = port.get(timeout=5)
                assert second.sender != packet.sender and packets.SweepCommand.from_bytes(packet.to_bytes()) == packet
                for long in (lambda: commands.start(material="x" * 57), lambda: commands.enroll("ü" * 29, 3)):
                    with pytest.raises(tactnet.TactnetError, match="material: expected a text of at most 56 bytes, found 5"):
                        long()
                assert port.get(timeout=0.05) is None
            for use in (commands.stop, lambda: port.get(timeout=0)):
                with pytest.raises(tactnet.TactnetError, match="Port is closed"):
                    use()
            # A closed put-port leaves its place to another one.
            for _ in range(20):
                bus.commands().close()
        with pytest.raises(tactnet.TactnetError, match="this Bus is closed"):
            bus.commands()


def test_get_raises_after_the_hub_has_stopped():
    from tactnet import channel, packets

    hub = channel.Hub(bus=f"stopping{os.getpid()}")
    bus = channel.Bus(hub.table)
    commands, port, beliefs = bus.commands(), bus.get_port("sweep/command", packets.SweepCommand), bus.beliefs()
    assert port.get(timeout=0) is None
    commands.stop(motion=5)
    hub.stop()
    # What had arrived is not lost.
    assert port.get(timeout=5).motion == 5
    begun = time.monotonic()
    for waiting in (port, beliefs):
        with pytest.raises(tactnet.TactnetError, match="no hub of bus `stopping"):
            waiting.get(timeout=60)
        with pytest.raises(tactnet.TactnetError, match="no hub"):
            next(iter(waiting))
    assert time.monotonic() - begun < 30
