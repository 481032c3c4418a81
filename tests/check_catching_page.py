#!/usr/bin/env python3
"""Runs `tactnet demo --catching` and opens its page in a headless Chromium. Usage: check_catching_page.py TACTNET SCREENSHOTS_FOLDER

Fails on console messages, if the robot or a flying ball is not drawn, if no caught ball is classified, if a belief is not shown, if content is cut
off or scrolls horizontally, or if the demo does not end when asked to. Writes screenshots: laptop and phone, light and dark.
"""

import itertools
import pathlib
import signal
import socket
import subprocess
import sys

from browser import Browser
from page import SIZES, check_frame, shoot, show_at, wait_for

tactnet = pathlib.Path(sys.argv[1]).resolve()
folder = pathlib.Path(sys.argv[2])
folder.mkdir(parents=True, exist_ok=True)
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    address = f"127.0.0.1:{free.getsockname()[1]}"
wrong = []
demo = subprocess.Popen([tactnet, "demo", "--catching", "--listen", address], stdout=subprocess.PIPE, text=True)
try:
    if demo.stdout.readline() != "ready\n":
        sys.exit("the demo did not start")
    browser = Browser()
    try:
        for domain in ("Page", "Runtime", "Log"):
            browser.call(f"{domain}.enable")
        browser.call("Page.navigate", url=f"http://{address}/")
        show_at(browser, "laptop", "light")
        wait_for(browser, "document.readyState === 'complete' && typeof view !== 'undefined' && view && view.stage", 20, "the page loads", wrong)
        limbs = "document.querySelectorAll('#stage polyline').length === 4"
        wait_for(browser, limbs, 60, "body, head and both arms are drawn", wrong)
        wait_for(browser, "document.querySelectorAll('#stage .was').length > 5", 60, "a ball flies, with its trail", wrong)
        shoot(browser, folder, "flight")
        # Balls out of reach are missed and not classified.
        feels = "view.stage.holds !== null && view.belief && document.getElementById('stage-about').textContent.includes('feels the ball')"
        if wait_for(browser, feels, 90, "a caught ball is felt", wrong):
            for size, scheme in itertools.product(SIZES, ("light", "dark")):
                show_at(browser, size, scheme)
                check_frame(browser, f"{size} {scheme}", wrong)
                shoot(browser, folder, f"{size}_{scheme}")
            show_at(browser, "laptop", "light")
        outcome = "/caught with the (left|right) hand; felt like .+, it is .+: (right|wrong)\\.$/.test(document.getElementById('stage-last').textContent)"
        wait_for(browser, outcome, 40, "the true material of the ball is shown", wrong)
        wait_for(browser, "/^\\d+ of \\d+ felt right/.test(document.getElementById('stage-felt').textContent)", 5, "the outcome is counted", wrong)
        if browser.run("document.querySelector('#stage-last').getAttribute('aria-live')") != "polite":
            wrong.append("the outcome of a ball is not announced to screen readers")
        for event in browser.events:
            method, parameters = event.get("method"), event.get("params", {})
            if method in ("Runtime.consoleAPICalled", "Runtime.exceptionThrown"):
                wrong.append(f"console: {parameters}")
        demo.send_signal(signal.SIGTERM)
        if demo.wait(30) != 0:
            wrong.append(f"the demo ended with {demo.returncode}")
    finally:
        browser.close()
finally:
    # If killed at once, it could not end its child processes.
    demo.terminate()
    try:
        demo.wait(20)
    except subprocess.TimeoutExpired:
        demo.kill()
if wrong:
    sys.exit("\n".join(wrong))
print(f"the catching page passes all checks; screenshots in {folder}")
