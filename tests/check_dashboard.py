#!/usr/bin/env python3
"""Runs `tactnet demo` and opens its page in a headless Chromium. Usage: check_dashboard.py TACTNET SCREENSHOTS_FOLDER

Fails on console messages, requests to other servers, and missing parts of the page: prediction, true material, score, skin, traces. Fails if more
than three sweeps are fused, a prediction during a sweep is not marked provisional, the scale shrinks after a sweep, a stale page looks live, content is
cut off or scrolls horizontally, or the demo does not end when asked to. Fails unless a skin with transposed taxels shows the banner `unlike the
training data` and an unchanged one does not. Writes screenshots: laptop and phone, light and dark, without a connection, and
with other skins and numbers of materials.
"""

import itertools
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time

import page
from browser import Browser
from page import SIZES, show_at

SWEEPS_OF_AN_OBJECT = 3
PAINTED = "[...document.getElementById('{}').getContext('2d').getImageData(0, 0, 300, 200).data].some(v => v > 0)"
# A view of another skin with another number of materials, made from the last view.
OTHER_SKIN = """(() => {
  const n = ROWS * COLS, wave = t => Array.from({ length: n }, (_, i) => 60 + 50 * Math.sin(i / 3 + t / 20));
  const names = Array.from({ length: Math.min(MATERIALS, 5) }, (_, i) => ['material ' + (i + 1) + ' with quite a long name, as people give them', (5 - i) / 20]);
  const next = { ...view, rows: ROWS, cols: COLS, materials: MATERIALS, frame: wave(0), alive: true };
  next.trace = Array.from({ length: 750 }, (_, t) => wave(t).filter((_, i) => i % Math.ceil(n / 64) === 0));
  next.belief = { ...view.belief, stage: 'dropout', posterior: names, fused: names, fused_sweeps: 2 };
  next.object = { number: 7, truth: names[1][0], taught: true, several: false, sweeps: 2, answer: { material: names[0][0], nearest: names[0][0], probability: .25 }, right: false };
  traces = []; source.close(); source.onmessage({ data: JSON.stringify(next) }); show();
})()"""

# Texts during an object's first sweep, drawn and read in one step.
PROVISIONAL = """(() => {
  if (!view || !view.belief || view.belief.stage !== 'anytime' || view.object.sweeps > 0) return null;
  show();
  const bar = document.querySelector('#bars li b');
  return [...['sweep', 'answer-title'].map(id => document.getElementById(id).textContent), getComputedStyle(bar).backgroundImage];
})()"""
# Number of lines of a prediction with a very long name.
LONG_ANSWER = """(() => {
  const name = 'synthetic leather with a very coarse grain, reverse side', object = { ...view.object, sweeps: 2, answer: { material: name, nearest: name, probability: .9 } };
  view = { ...view, object }; show();
  const answer = document.getElementById('answer'), style = getComputedStyle(answer);
  return Math.round(answer.getBoundingClientRect().height / parseFloat(style.lineHeight));
})()"""
# A page opened while the skin is at rest, after a sweep with readings up to 3.2.
AT_REST = """(() => {
  traces = []; low_ = top_ = most_ = 0; source.close();
  const rest = view.frame.map(() => 0);
  source.onmessage({ data: JSON.stringify({ ...view, frame: rest, trace: [rest], range: { least: -0.4, most: 3.2, whole: false } }) });
  show();
  return document.getElementById('scale-low').textContent + ' to ' + document.getElementById('scale-high').textContent;
})()"""

# Number of verdicts on the likeness with the training data that are awaited.
VERDICTS = 6

tactnet = pathlib.Path(sys.argv[1]).resolve()
folder = pathlib.Path(sys.argv[2])
folder.mkdir(parents=True, exist_ok=True)
wrong = []


def free_address():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{free.getsockname()[1]}"


address = free_address()
demo = subprocess.Popen([tactnet, "demo", "--listen", address], stdout=subprocess.PIPE, text=True)


def wait_for(browser, script, seconds, what):
    return page.wait_for(browser, script, seconds, what, wrong)


def check_frame(browser, where):
    page.check_frame(browser, where, wrong)


def shoot(browser, name):
    page.shoot(browser, folder, name)


def check_live(browser):
    # Until the first object is finished: its sweeps are counted and then discarded.
    seen, provisional = [], None
    for _ in range(600):
        provisional = provisional or browser.run(PROVISIONAL)
        state = browser.run("view && view.object ? [view.object.number, view.object.sweeps, view.belief ? view.belief.fused_sweeps : 0] : null")
        if state and (not seen or seen[-1] != state):
            seen.append(state)
        if state and state[0] >= 2 and state[1] >= 1:
            break
        time.sleep(0.05)
    if not provisional or not re.fullmatch(r"Sweep \d, \d+ of \d+ readings, provisional: .+", provisional[0]) \
            or not provisional[1].startswith("Provisional") or "gradient" not in provisional[2]:
        wrong.append(f"a prediction during a sweep is not marked provisional: {provisional}")
    for number, sweeps, fused in seen:
        if max(sweeps, fused) > SWEEPS_OF_AN_OBJECT or fused > sweeps:
            wrong.append(f"object {number}: {fused} fused of {sweeps} sweeps")
    if [1, SWEEPS_OF_AN_OBJECT] not in [state[:2] for state in seen] or seen[-1][0] < 2:
        wrong.append(f"no reset after three sweeps: {seen}")
    # The true material arrives in another packet, and the browser draws when it has time. Each condition must hold once within three seconds,
    # in which no second object can finish.
    unseen = {
        "the state is live": "document.getElementById('state').className === 'alive'",
        "a material is shown": "document.getElementById('answer').textContent.length > 2",
        "the true material is shown": "/^(✓ Right|✗ Wrong): it is .+/.test(document.getElementById('truth').textContent)",
        "the score counts the first object": "/^[01] of 1$/.test(document.getElementById('score').textContent)",
        "the outcome of the first object is shown": "document.querySelectorAll('#marks li').length === 1",
        "probabilities are shown": "document.querySelectorAll('#bars li').length === 6",
        "counters are shown": "document.querySelectorAll('#counters div').length >= 6",
        "no reading is lost": "view.counters.some(([name, n]) => name === 'lost readings' && n === 0)",
        "events contain sweeps with their true material": "/sweep 1: .*, it was /.test(document.getElementById('events').innerText)",
        "events contain the object with its true material": "/\\d\\d:\\d\\d:\\d\\d.*object 1: said .*it was /.test(document.getElementById('events').innerText.replaceAll('\\n', ' '))",
        "the skin is drawn": PAINTED.format("heat"),
        "traces are drawn": PAINTED.format("traces"),
        "the scale has an end and a unit": "/^0\\d+raw sensor reading$/.test(document.getElementById('scale').textContent)",
        "the prediction is announced to screen readers": "document.querySelector('#said[aria-live=polite]').textContent.includes('. It is ')",
        "nothing is marked stale": "!document.body.classList.contains('stale') && !document.getElementById('age').textContent",
    }
    for _ in range(60):
        unseen = {what: script for what, script in unseen.items() if not browser.run(script)}
        if not unseen:
            break
        time.sleep(0.05)
    if unseen:
        state = browser.run("JSON.stringify({ object: view.object, belief: view.belief, truth: document.getElementById('truth').textContent })")
        wrong += [f"failed: {what}; state of the page: {state}" for what in unseen]


def check_choice(browser):
    """Sensors can be selected by mouse and keyboard, and the keyboard reaches every control."""
    box = browser.run("(() => { const b = heatBox(), r = document.getElementById('heat').getBoundingClientRect(); return [r.left + b.left, r.top + b.top, b.side]; })()")
    browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=box[0] + 2.5 * box[2], y=box[1] + 1.5 * box[2])
    if not browser.run("document.getElementById('chosen').textContent.startsWith('Sensor in row 2, column 3: now ')"):
        wrong.append("the mouse does not select the sensor in row 2, column 3")
    shoot(browser, "laptop_chosen")
    reached = []
    for _ in range(4):
        browser.press("Tab", 9)
        reached.append(browser.run("document.activeElement.id"))
        if reached[-1] == "heat":
            browser.press("Escape", 27)
            browser.press("ArrowRight", 39)
            browser.press("ArrowDown", 40)
            if not browser.run("document.getElementById('chosen-said').textContent.startsWith('Sensor in row 2, column 1')"):
                wrong.append("the arrow keys do not select a sensor")
            browser.press("Escape", 27)
    if not {"reset", "heat", "events"} <= set(reached):
        wrong.append(f"the keyboard reaches only {reached}")


def end(process):
    """Ends a demo. If killed at once, it could not end its child processes."""
    process.terminate()
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()


def check_banner(run, faults, shown):
    """The banner is shown for a skin with faults, and only then; `shown` is its expected text or empty."""
    where = " ".join(faults) or "unchanged skin"
    own = free_address()
    process = subprocess.Popen([tactnet, "demo", "--run", run, "--listen", own, *faults], stdout=subprocess.PIPE, text=True)
    browser = None
    try:
        if process.stdout.readline() != "ready\n":
            return wrong.append(f"{where}: the demo did not start")
        browser = Browser()
        browser.call("Page.enable")
        browser.call("Page.navigate", url=f"http://{own}/")
        wait_for(browser, "typeof view !== 'undefined' && view && view.counters.length > 0", 10, f"{where}: the page loads")
        show_at(browser, "laptop", "light")
        if shown:
            # Few sweeps of one material may show only that another taxel is quiet.
            if wait_for(browser, f"document.getElementById('unlike').textContent.includes('{shown}')", 60, f"{where}: the banner is shown"):
                text = browser.run("document.getElementById('unlike').textContent")
                if not text.startswith("UNLIKE the training data (p = 0.0") or browser.run("document.getElementById('unlike').hidden"):
                    wrong.append(f"{where}: the banner says `{text}`")
                for size in SIZES:
                    show_at(browser, size, "light")
                    check_frame(browser, f"{size} {where}")
                    shoot(browser, f"{size}_unlike")
        else:
            browser.run("seen = false; setInterval(() => { seen = seen || !document.getElementById('unlike').hidden; }, 20)")
            sweeps = f"view.counters.some(([name, n]) => name === 'sweeps classified' && n > {VERDICTS})"
            wait_for(browser, sweeps, 60, f"{where}: sweeps are classified")
            if browser.run("seen"):
                wrong.append(f"{where}: the banner was shown")
    finally:
        if browser:
            browser.close()
        end(process)


def check_banners():
    with tempfile.TemporaryDirectory() as lab:
        data, run = f"{lab}/sweeps.h5", f"{lab}/run"
        for words in (["data", "twin", "--materials", "4", "--sweeps", "30", "--out", data], ["train", "--epochs", "1", "--data", data, "--out", run]):
            subprocess.run([tactnet, *words], check=True, stdout=subprocess.DEVNULL)
        check_banner(run, ["--taxel-order", "transposed"], "taxels are transposed: rows and columns are exchanged")
        check_banner(run, [], "")


try:
    if demo.stdout.readline() != "ready\n":
        sys.exit("the demo did not start")
    browser = Browser()
    try:
        for domain in ("Page", "Runtime", "Log", "Network"):
            browser.call(f"{domain}.enable")
        browser.call("Page.navigate", url=f"http://{address}/")
        wait_for(browser, "document.readyState === 'complete' && typeof view !== 'undefined'", 10, "the page loads")
        show_at(browser, "laptop", "light")
        check_live(browser)
        for size, scheme in itertools.product(SIZES, ("light", "dark")):
            show_at(browser, size, scheme)
            check_frame(browser, f"{size} {scheme}")
            shoot(browser, f"{size}_{scheme}")
        show_at(browser, "laptop", "light")
        check_choice(browser)
        before = browser.run("view.object.number")
        browser.run("document.getElementById('reset').click()")
        wait_for(browser, f"view.object.number > {before}", 5, "the button starts a new object")
        wait_for(browser, "view.object.answer", 10, "the new object is classified")
        demo.send_signal(signal.SIGTERM)
        if demo.wait(20) != 0:
            wrong.append(f"the demo ended with {demo.returncode}")
        events = list(browser.events)
        if wait_for(browser, "document.body.classList.contains('stale')", 5, "a page without a connection is stale"):
            time.sleep(1.2)
            for name in ("answer", "bars", "truth", "heat"):
                if browser.run(f"Number(getComputedStyle(document.getElementById('{name}')).opacity)") > 0.6:
                    wrong.append(f"stale but not greyed out: {name}")
            age = browser.run("document.getElementById('age').textContent")
            if not re.fullmatch(r"Stale: this prediction is [1-9]\d* s old\.", age):
                wrong.append(f"a stale prediction without its age: `{age}`")
            shoot(browser, "laptop_stale")
        if (scale := browser.run(AT_REST)) != "-0.50 to 3.50":
            wrong.append(f"the scale of a skin at rest with readings from -0.4 to 3.2 is {scale}")
        for size, most in (("laptop", 2), ("phone", 3)):
            show_at(browser, size, "light")
            if (lines := browser.run(LONG_ANSWER)) > most:
                wrong.append(f"{size}: a prediction of 56 characters takes {lines} lines")
        for rows, cols, materials in ((8, 8, 64), (6, 10, 2), (32, 32, 12)):
            for size in SIZES:
                show_at(browser, size, "dark" if materials == 2 else "light")
                browser.run(OTHER_SKIN.replace("ROWS", str(rows)).replace("COLS", str(cols)).replace("MATERIALS", str(materials)))
                check_frame(browser, f"{size} {rows}x{cols}, {materials} materials")
                if browser.run("document.querySelectorAll('#bars li').length") != min(materials, 6):
                    wrong.append(f"{materials} materials: wrong number of bars")
                shoot(browser, f"{size}_{rows}x{cols}_{materials}")
        for event in events:
            method, parameters = event.get("method"), event.get("params", {})
            if method == "Network.requestWillBeSent" and not parameters["request"]["url"].startswith((f"http://{address}/", "data:")):
                wrong.append(f"request to {parameters['request']['url']}")
            if method == "Runtime.consoleAPICalled" or method == "Runtime.exceptionThrown":
                wrong.append(f"console: {parameters}")
            # The second message concerns this script's reading of pixels, the third the end of the demo.
            if method == "Log.entryAdded" and not any(word in str(parameters) for word in ("favicon", "willReadFrequently", "/events")):
                wrong.append(f"log: {parameters}")
    finally:
        browser.close()
finally:
    end(demo)
check_banners()
if wrong:
    sys.exit("\n".join(wrong))
print(f"the dashboard passes all checks; screenshots in {folder}")
