#!/usr/bin/env python3
"""Opens an export with MLflow and prints its contents as JSON. Usage: open_with_mlflow.py DIR

    pip install mlflow-skinny pandas
"""

import json
import os
import pathlib
import sys

os.environ.setdefault("MLFLOW_ALLOW_FILE_STORE", "true")
from mlflow.tracking import MlflowClient  # noqa: E402

client = MlflowClient(tracking_uri=pathlib.Path(sys.argv[1]).resolve().as_uri())
found = {}
for experiment in client.search_experiments():
    runs = client.search_runs([experiment.experiment_id], max_results=1000)
    found[experiment.name] = {
        run.info.run_name: {
            "status": run.info.status,
            "params": dict(run.data.params),
            "metrics": dict(run.data.metrics),
            "epochs": len(client.get_metric_history(run.info.run_id, "train_loss"))
            if "train_loss" in run.data.metrics
            else 0,
            "artifacts": sorted(artifact.path for artifact in client.list_artifacts(run.info.run_id)),
        }
        for run in runs
    }
print(json.dumps(found))
