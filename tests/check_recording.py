#!/usr/bin/env python3
"""Opens a recording with the mcap package, and an exported network with ONNX Runtime.

    pip install mcap mcap-protobuf-support numpy onnx onnxruntime

Usage: check_recording.py FILE.mcap FILE.onnx FILE_WITH_MASKS.onnx

The recording must decode with its embedded schemas. On the recorded sweeps the network must reproduce the recorded plain beliefs within 1e-4.
"""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy
import onnx
import onnxruntime
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

recording, network, network_with_masks = sys.argv[1:4]
frames, starts, beliefs, names = {}, [], [], None
with open(recording, "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    summary = reader.get_summary()
    about = {record.name: record.metadata for record in reader.iter_metadata()}["tactnet"]
    for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=True):
        assert schema.encoding == channel.message_encoding == "protobuf", schema
        if schema.name == "tactnet.SkinFrame":
            frames[decoded.sequence] = numpy.array(decoded.digits, dtype=numpy.float32)
        elif schema.name == "tactnet.SweepCommand" and decoded.kind == 1:
            starts.append(decoded.motion)
        elif schema.name == "tactnet.TactileBelief" and decoded.stage == 2:
            beliefs.append(decoded)
        elif schema.name == "tactnet.ModelNames":
            names = list(decoded.names)
assert "table" in about and frames and beliefs and names
counts = {summary.channels[i].topic: n for i, n in summary.statistics.channel_message_counts.items()}

model = onnx.load(network)
onnx.checker.check_model(model, full_check=True)
properties = {item.key: item.value for item in model.metadata_props}
assert json.loads(properties["labels"]) == names
steps = int(properties["window_steps"])
# The Python program in the file must run unchanged, and ONNX Runtime must print no message about it.
for exported in (network, network_with_masks):
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(exported, pathlib.Path(folder) / "model.onnx")
        program = onnx.load(exported).doc_string.split("\n\n")[1]
        ran = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True)
    assert ran.stdout.strip() in names and not ran.stderr, (program, ran)
session = onnxruntime.InferenceSession(network)
with_masks = onnxruntime.InferenceSession(network_with_masks)
features = with_masks.get_inputs()[1].shape[1]
apart = 0.0
for belief in beliefs:
    if belief.motion not in starts or belief.filled_in:
        continue
    window = range(belief.last_frame - steps + 1, belief.last_frame + 1)
    digits = numpy.stack([frames[sequence] for sequence in window])[None]
    (plain,) = session.run(["log_probability"], {"digits": digits})
    masks = numpy.ones((2, features), numpy.float32)
    outputs = ["mc_log_probability", "mutual_information"]
    mixed, information = with_masks.run(outputs, {"digits": digits, "masks": masks})
    apart = max(apart, float(numpy.abs(numpy.exp(plain[0]) - numpy.array(belief.posterior)).max()))
    # Masks that keep everything give no variance.
    assert numpy.allclose(plain, mixed, atol=1e-5) and abs(information[0]) < 1e-5
assert apart < 1e-4, apart
print(f"{counts}: fine; ONNX Runtime differs from {len(beliefs)} recorded beliefs by at most {apart:.1e}")
