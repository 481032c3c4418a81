"""Reads a run's `predictions_test.csv` with tsml-eval's own loader and checks it against the run's `result.json`.

    pip install tsml-eval && python tests/golden/read_predictions_with_tsml_eval.py RUN

Exits with an error if the loader refuses the file or finds another accuracy or likelihood than tactnet.
"""

import importlib.metadata
import json
import pathlib
import sys

from tsml_eval.evaluation.storage import load_classifier_results

run = pathlib.Path(sys.argv[1])
result = json.loads((run / "result.json").read_text())
loaded = load_classifier_results(str(run / "predictions_test.csv"), verify_values=True)
loaded.calculate_statistics()
accuracy = result["accuracy_one_sweep"]["mean"]
assert loaded.n_cases == result["n_test"], (loaded.n_cases, result["n_test"])
assert abs(loaded.accuracy - accuracy) < 1e-12, (loaded.accuracy, accuracy)
likelihoods = [e["negative_log_likelihood"] for e in result["evaluations"].values()]
assert min(abs(loaded.log_loss - likelihood) for likelihood in likelihoods) < 1e-6, (loaded.log_loss, likelihoods)
version = importlib.metadata.version("tsml-eval")
print(f"tsml-eval {version}: {loaded.n_cases} cases, accuracy {loaded.accuracy:.4f}, log loss {loaded.log_loss:.6f}")
