#!/usr/bin/env python3
"""Runs `tactnet demo` and opens its page in a real headless Chromium. Usage: check_dashboard.py TACTNET SCREENSHOTS_FOLDER

Fails on any console message, a request to anywhere else, a page without belief, skin, traces or counters, sideways scrolling, or a demo that
does not end when asked to. Leaves screenshots: wide and narrow, light and dark.
"""

import base64
import itertools
import pathlib
import signal
import socket
import subprocess
import sys
import time

from browser import Browser

tactnet = pathlib.Path(sys.argv[1]).resolve()
folder = pathlib.Path(sys.argv[2])
folder.mkdir(parents=True, exist_ok=True)
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    address = f"127.0.0.1:{free.getsockname()[1]}"

demo = subprocess.Popen([tactnet, "demo", "--listen", address], stdout=subprocess.PIPE, text=True)
wrong = []
try:
    if demo.stdout.readline() != "ready\n":
        sys.exit("the demo did not start")
    browser = Browser()
    try:
        for domain in ("Page", "Runtime", "Log", "Network"):
            browser.call(f"{domain}.enable")
        browser.call("Page.navigate", url=f"http://{address}/")
        # A belief of a whole sweep, so that the fused ones are there, too.
        for _ in range(300):
            time.sleep(0.1)
            if browser.run("document.querySelectorAll('#fused .bar').length"):
                break
        for width, scheme in itertools.product((1280, 390), ("light", "dark")):
            browser.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 600)
            browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            time.sleep(0.5)
            for what, script in {
                "the classifier is said to serve": "document.getElementById('state').className === 'alive'",
                "a material is named": "document.getElementById('guess').textContent.length > 2",
                "probabilities are shown": "document.querySelectorAll('#posterior .bar').length >= 5",
                "fused probabilities are shown": "document.querySelectorAll('#fused .bar').length >= 5",
                "counters are shown": "document.querySelectorAll('#counters tr').length >= 6",
                "no frame is lost": "[...document.querySelectorAll('#counters tr')].some(r => r.innerText.includes('lost') && r.cells[1].innerText === '0')",
                "the skin is drawn": "[...document.getElementById('heat').getContext('2d').getImageData(0, 0, 200, 200).data].some(v => v > 0)",
                "traces are drawn": "[...document.getElementById('traces').getContext('2d').getImageData(0, 0, 300, 250).data].some(v => v > 0)",
                "the page does not scroll sideways": "document.documentElement.scrollWidth <= innerWidth",
                "the button has a name": "document.getElementById('reset').textContent.length > 0",
            }.items():
                if not browser.run(script):
                    wrong.append(f"{width} {scheme}: not so: {what}")
            shot = browser.call("Page.captureScreenshot", captureBeyondViewport=True, format="png")
            (folder / f"{width}_{scheme}.png").write_bytes(base64.b64decode(shot["data"]))
        browser.run("document.getElementById('reset').click()")
        for _ in range(50):
            time.sleep(0.1)
            if browser.run("document.getElementById('events').innerText.includes('fused sweeps forgotten')"):
                break
        else:
            wrong.append("the button does not reset the fused sweeps")
        for event in browser.events:
            method, parameters = event.get("method"), event.get("params", {})
            if method == "Network.requestWillBeSent" and not parameters["request"]["url"].startswith(f"http://{address}/"):
                wrong.append(f"request to {parameters['request']['url']}")
            if method == "Runtime.consoleAPICalled" or method == "Runtime.exceptionThrown":
                wrong.append(f"console: {parameters}")
            # The second is about this script's own reading of pixels.
            if method == "Log.entryAdded" and not any(word in str(parameters) for word in ("favicon", "willReadFrequently")):
                wrong.append(f"log: {parameters}")
    finally:
        browser.close()
    demo.send_signal(signal.SIGTERM)
    if demo.wait(20) != 0:
        wrong.append(f"the demo ended with {demo.returncode}")
finally:
    # Killed at once it could not end its parts.
    demo.terminate()
    try:
        demo.wait(20)
    except subprocess.TimeoutExpired:
        demo.kill()
if wrong:
    sys.exit("\n".join(wrong))
print(f"the dashboard is sound; screenshots in {folder}")
