#!/usr/bin/env python3
"""Opens the output of `tactnet view` in Rerun's library and viewer. Usage:

    check_view.py sweeps    DATA.npz DATA.rrd PICTURES     a file of `tactnet data view` contains the data set's values
    check_view.py live      URL PICTURES                   a viewer fed by `tactnet view --connect`
    check_view.py throw     FILE.rrd PICTURES              a caught throw of `tactnet catch throw-series --view`
    check_view.py recording FILE.mcap FILE.rrd PICTURES    a recording, directly and through `tactnet view --save`

    pip install rerun-sdk==0.36.3 numpy; a Vulkan driver (mesa's lavapipe is enough)

PICTURES is a folder for the screenshots, or an empty string. The viewer runs without a screen.
"""

import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time

import numpy
import PIL.Image
from rerun.experimental import McapReader, RrdReader, ViewerClient

kind, *inputs, pictures = sys.argv[1:]
# A viewer that does not respond is an error.
signal.alarm(180)
folder = pathlib.Path(pictures or tempfile.mkdtemp())
folder.mkdir(parents=True, exist_ok=True)


def colorful(path):
    """Returns the share of pixels that are not grey."""
    image = numpy.asarray(PIL.Image.open(path).convert("RGB")).astype(int)
    return float(((image.max(axis=2) - image.min(axis=2)) > 60).mean())


def screenshot(url, name, least, patience=60):
    """Waits until the viewer shows images."""
    # The axes need time to find their range.
    time.sleep(3)
    out, begun, share = folder / f"{name}.png", time.monotonic(), 0.0
    while time.monotonic() - begun < patience:
        out.unlink(missing_ok=True)
        ViewerClient(url=url).save_screenshot(str(out))
        while not out.exists() and time.monotonic() - begun < patience:
            time.sleep(0.1)
        time.sleep(0.5)
        try:
            share = colorful(out)
        except OSError:  # not completely written yet
            continue
        if share >= least:
            return share
        time.sleep(1)
    raise AssertionError(f"{out}: a share of {share:.4f} of the image has colours, expected {least}")


def show(file, name, least):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    viewer = subprocess.Popen(
        [sys.executable, "-m", "rerun", "--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "1400x900", str(file)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        begun = time.monotonic()
        while True:
            try:
                socket.create_connection(("127.0.0.1", port)).close()
                break
            except OSError:
                assert time.monotonic() - begun < 60 and viewer.poll() is None, "no viewer"
                time.sleep(0.1)
        return screenshot(f"rerun+http://127.0.0.1:{port}/proxy", name, least)
    finally:
        # The launcher and the viewer itself.
        os.killpg(viewer.pid, signal.SIGKILL)
        viewer.wait()


def rows(reader, entity, column):
    """Returns the lists of one column of one entity, ordered by time."""
    found = []
    for chunk in reader.stream():
        if str(chunk.entity_path) != entity or chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        names = batch.schema.names
        values = next(i for i, name in enumerate(names) if name.endswith(column))
        times = names.index("time")
        found += zip(batch.column(times).cast("int64").to_pylist(), batch.column(values).to_pylist())
    # Rows without values end lines.
    found = [row for row in found if row[1]]
    found.sort(key=lambda row: row[0])
    return [value for _, value in found]


if kind == "sweeps":
    data, file = inputs
    arrays = numpy.load(data)
    samples = arrays["samples"]
    traces = numpy.array(rows(RrdReader(file), "/skin/traces", "Scalars:scalars"))
    steps, taxels = samples.shape[-3], samples.shape[-2] * samples.shape[-1]
    sweeps = samples.reshape(-1, steps, taxels)
    shown = traces.reshape(-1, steps, taxels)
    for sweep in shown:
        assert (numpy.abs(sweeps - sweep).max(axis=(1, 2)) == 0).any(), "no sweep of the data set"
    assert len(shown) == 8, len(shown)
    heatmaps = rows(RrdReader(file), "/skin/heatmap", "Tensor:data")
    # 25 per second.
    assert abs(len(heatmaps) - 8 * steps / 750 * 25) <= 8, len(heatmaps)
    print(f"{len(shown)} sweeps, {len(heatmaps)} heatmaps: fine; colors {show(file, 'sweeps', 0.02):.3f}")
elif kind == "live":
    print(f"fine; colors {screenshot(inputs[0], 'live', 0.02):.3f}")
elif kind == "throw":
    file = inputs[0]
    links = {str(chunk.entity_path) for chunk in RrdReader(file).stream() if str(chunk.entity_path).startswith("/world/bodies/")}
    assert len(links) == 12, links
    # Links are rigid, except the neck, which ends at the true pose of the head.
    for link in links:
        lengths = numpy.array(rows(RrdReader(file), link, "lengths")).ravel()
        assert numpy.ptp(lengths) < (0.05 if link.endswith(("neck", "torso")) else 1e-3), (link, numpy.ptp(lengths))
    ball = numpy.array(rows(RrdReader(file), "/world/balls/1", "positions"))[:, 0]
    # The ball starts far away and ends in a hand.
    assert ball[0, 0] > 3.5, ball[0]
    hands = []
    for side in ("left", "right"):
        start = numpy.array(rows(RrdReader(file), f"/world/bodies/{side}-hand", "translations"))[:, 0]
        x, y, z, w = numpy.array(rows(RrdReader(file), f"/world/bodies/{side}-hand", "quaternions"))[:, 0].T
        length = numpy.array(rows(RrdReader(file), f"/world/bodies/{side}-hand", "lengths"))
        axis = numpy.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
        hands.append((start + axis * length)[len(ball) - 1])
    near = min(float(numpy.linalg.norm(ball[-1] - hand)) for hand in hands)
    assert near < 0.06, near
    print(f"fine, {len(ball)} places of the ball, {1000 * near:.0f} mm from a hand; colors {show(file, 'throw', 0.005):.3f}")
else:
    recording, file = inputs
    entities = {str(chunk.entity_path) for chunk in McapReader(recording).stream()}
    assert any("skin/right" in entity for entity in entities) and any("tactile/belief" in entity for entity in entities), entities
    frames = rows(RrdReader(file), "/skin/right/traces", "Scalars:scalars")
    posterior = rows(RrdReader(file), "/skin/right/belief/posterior", "Scalars:scalars")
    assert posterior and all(abs(sum(p) - 1) < 1e-3 for p in posterior)
    recorded = sum(chunk.num_rows for chunk in McapReader(recording).stream() if str(chunk.entity_path) == "/skin/right" and not chunk.is_static)
    assert len(frames) == recorded > 0, (len(frames), recorded)
    shown = {str(chunk.entity_path).removeprefix("/skin/right/") for chunk in RrdReader(file).stream()}
    expected = {"heatmap", "belief/bars/length", "belief/bars/name", "belief/text", "latency/plain", "latency/dropout", "/events"}
    assert expected <= shown, expected - shown
    raw = show(recording, "recording_as_it_is", 0.0)
    print(f"{len(frames)} frames, {len(posterior)} beliefs: fine; colors {show(file, 'recording', 0.02):.3f}, {raw:.3f}")
