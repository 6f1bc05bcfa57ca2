#!/usr/bin/env python3
"""Looks at a report in headless Chromium, as a person would.

    browser.py FOLDER [SCREENSHOTS]

Speaks WebDriver to `chromedriver` with nothing but the standard library. Prints one line for each check; exits with 1 at
the first that fails, with 77 where there is no browser. With a folder for screenshots it also writes what it saw, at
desktop and phone width, light and dark, and the page as it is printed.
"""

import base64
import json
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

SKIPPED = 77
RIGHT, HOME = "\ue014", "\ue011"


class Browser:
    """A Chromium driven through chromedriver."""

    def __init__(self, driver, chromium, profile):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.server = subprocess.Popen(
            [driver, f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self.address = f"http://127.0.0.1:{port}"
        self.session = None
        deadline = time.monotonic() + 60
        while True:
            try:
                if self.call("GET", "/status")["ready"]:
                    break
            except OSError:
                pass
            if time.monotonic() > deadline:
                raise RuntimeError("chromedriver does not answer")
            time.sleep(0.1)
        arguments = [
            "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            "--hide-scrollbars", "--window-size=1280,900", f"--user-data-dir={profile}",
        ]
        options = {"binary": chromium, "args": arguments, "perfLoggingPrefs": {"enableNetwork": True}}
        capabilities = {
            "browserName": "chrome",
            "goog:chromeOptions": options,
            "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
        }
        answer = self.call("POST", "/session", {"capabilities": {"alwaysMatch": capabilities}})
        self.session = f"/session/{answer['sessionId']}"

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.address + path, data, {"Content-Type": "application/json"}, method=method)
        # The driver is on this machine: no proxy has a part in it.
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        try:
            with opener.open(request, timeout=120) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(f"{path}: {json.load(error)['value']['message']}") from None

    def post(self, path, **body):
        return self.call("POST", self.session + path, body)

    def devtools(self, command, **parameters):
        return self.post("/goog/cdp/execute", cmd=command, params=parameters)

    def run(self, script, *arguments):
        return self.post("/execute/sync", script=script, args=list(arguments))

    def press(self, key):
        actions = [{"type": "keyDown", "value": key}, {"type": "keyUp", "value": key}]
        self.post("/actions", actions=[{"type": "key", "id": "keyboard", "actions": actions}])

    def drag(self, start, end):
        def move(place):
            return {"type": "pointerMove", "duration": 50, "x": round(place[0]), "y": round(place[1])}

        actions = [move(start), {"type": "pointerDown", "button": 0}, move(end), {"type": "pointerUp", "button": 0}]
        self.post("/actions", actions=[{"type": "pointer", "id": "mouse", "actions": actions}])

    def log(self, kind):
        return self.post("/se/log", type=kind)

    def size(self, width, height, phone=False):
        self.devtools(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone
        )

    def scheme(self, scheme, media=""):
        feature = {"name": "prefers-color-scheme", "value": scheme}
        self.devtools("Emulation.setEmulatedMedia", media=media, features=[feature])

    def picture(self, whole=True):
        taken = self.devtools("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        return base64.b64decode(taken["data"])

    def close(self):
        if self.session:
            self.call("DELETE", self.session)
        self.server.terminate()
        self.server.wait(timeout=20)


def check(what, holds, found=""):
    print(f"{'ok' if holds else 'FAILED'}: {what}{'' if holds else f': {found}'}", flush=True)
    if not holds:
        raise SystemExit(1)


def look(browser, folder, shots):
    page = (folder / "index.html").resolve().as_uri()
    browser.post("/url", url=page)
    check("the page has a title", "Raster or rays" in browser.run("return document.title"))
    broken = browser.run("return [...document.images].filter(i => !i.complete || !i.naturalWidth).map(i => i.src)")
    check("every picture loads", broken == [], broken)

    slider = "const box = document.querySelector('.compare'); const range = box && box.querySelector('input[type=range]');"
    check("there is a slider", browser.run(slider + "return Boolean(range) && !box.hidden"))
    clip = slider + "return getComputedStyle(box.querySelector('.over')).clipPath"
    # The page scrolls smoothly: places measured meanwhile would be wrong.
    browser.run(
        slider + "box.querySelector('.stage').scrollIntoView({behavior: 'instant', block: 'center'});"
        "range.focus({preventScroll: true})"
    )
    before, shown = browser.run(clip), browser.picture(False)
    for _ in range(10):
        browser.press(RIGHT)
    check("arrow keys move the value", browser.run(slider + "return range.value") == "60")
    check("arrow keys move the picture", browser.run(clip) != before, before)
    check("what is seen changes", browser.picture(False) != shown)
    browser.press(HOME)
    check("the Home key uncovers all of the right picture", browser.run(slider + "return range.value") == "0")
    browser.run(slider + "range.value = 25; range.dispatchEvent(new Event('input', {bubbles: true}))")
    check("setting the value moves the picture", "75%" in browser.run(clip), browser.run(clip))
    left, top, width, height = browser.run(
        slider + "const r = range.getBoundingClientRect(); return [r.left, r.top, r.width, r.height]"
    )
    browser.drag((left + width * 0.25, top + height / 2), (left + width * 0.8, top + height / 2))
    dragged = float(browser.run(slider + "return range.value"))
    check("dragging moves the divider", 70 <= dragged <= 90, dragged)
    name = slider + "return range.getAttribute('aria-label')"
    labelled = browser.run(name)
    browser.run(
        slider + "const s = box.querySelector('select'); s.selectedIndex = 1; s.dispatchEvent(new Event('change'))"
    )
    check("another picture can be chosen", browser.run(name) != labelled, labelled)
    check(
        "the picture chosen is the one shown",
        browser.run(slider + "return box.querySelector('.over').src.endsWith(box.querySelector('select').value)"),
    )

    table = "const table = document.querySelector('#effects').parentNode.querySelector('table.sortable');"
    values = table + "return [...table.tBodies[0].rows].map(row => Number(row.cells[3].dataset.v))"
    press = table + "table.querySelector('th[data-column=\"3\"] button').click()"
    browser.run(press)
    found = browser.run(values)
    check("a click sorts the table", len(found) > 3 and found == sorted(found), found)
    browser.run(press)
    found = browser.run(values)
    check("a second click sorts it the other way", found == sorted(found, reverse=True), found)
    state = browser.run(table + "return table.querySelector('th[data-column=\"3\"]').getAttribute('aria-sort')")
    check("the order is told to assistive programs", state == "descending", state)

    # The answer is seen without scrolling: every effect with its verdict.
    browser.run("window.scrollTo({top: 0, behavior: 'instant'})")
    last = (
        "const rows = document.querySelector('.short table').tBodies[0].rows; const cell = rows[rows.length - 1].cells[1];"
        "const box = cell.getBoundingClientRect(); return [rows.length, box.right, box.bottom]"
    )
    for width, height in ((1280, 800), (390, 844)):
        browser.size(width, height, width < 600)
        count, right, bottom = browser.run(last)
        seen_at_once = count == 4 and right <= width and bottom <= height
        check(f"the verdicts are seen at once at {width} x {height}", seen_at_once, (count, right, bottom))

    overflow = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
    for width in (1280, 360):
        browser.size(width, 800, width < 600)
        check(f"no sideways scrolling at {width} pixels", browser.run(overflow) <= 0, browser.run(overflow))

    ground = "return getComputedStyle(document.body).backgroundColor"
    axis = "return getComputedStyle(document.querySelector('.plot svg text')).fill"
    seen = {}
    for scheme in ("light", "dark"):
        browser.scheme(scheme)
        seen[scheme] = (browser.run(ground), browser.run(axis))
        if shots:
            for name, width in (("desktop", 1280), ("phone", 390)):
                browser.size(width, 900, width < 600)
                (shots / f"{name}-{scheme}.png").write_bytes(browser.picture())
    check("the dark page has another ground", seen["light"][0] != seen["dark"][0], seen)
    check("the dark plots have another ink", seen["light"][1] != seen["dark"][1], seen)

    side_by_side = (
        "const hidden = e => getComputedStyle(e).display === 'none';"
        "return hidden(document.querySelector('.compare')) && !hidden(document.querySelector('.pictures'))"
    )
    browser.size(1280, 900)
    browser.scheme("light", "print")
    check("printed pictures stand side by side", browser.run(side_by_side))
    browser.size(700, 1000)
    check("printed tables fit on the paper", browser.run(overflow) <= 0, browser.run(overflow))
    browser.size(1280, 900)
    if shots:
        browser.size(794, 1123)
        (shots / "printed.png").write_bytes(browser.picture())
        browser.size(1280, 900)
    browser.scheme("light")
    check("on the screen they do not", not browser.run(side_by_side))
    if shots:
        printed = browser.devtools("Page.printToPDF", preferCSSPageSize=True, printBackground=True)
        (shots / "printed.pdf").write_bytes(base64.b64decode(printed["data"]))

    errors = [entry["message"] for entry in browser.log("browser") if entry["level"] in ("SEVERE", "WARNING")]
    check("the console has no errors", errors == [], errors)
    asked = set()
    for entry in browser.log("performance"):
        message = json.loads(entry["message"])["message"]
        # The browser's own start page asks for things too.
        if message["method"] == "Network.requestWillBeSent" and message["params"]["documentURL"] == page:
            asked.add(message["params"]["request"]["url"])
    outside = [url for url in asked if not url.startswith(("file:", "data:"))]
    check("requests were seen", any(url.endswith(".png") for url in asked), asked)
    check("no request leaves the disk", outside == [], outside)

    browser.devtools("Emulation.setScriptExecutionDisabled", value=True)
    browser.post("/url", url=page)
    check("without its script the pictures stand side by side", browser.run(side_by_side))
    check("without its script the tables are whole", len(browser.run(values)) > 3)


def main():
    folder = pathlib.Path(sys.argv[1])
    shots = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
    driver = shutil.which("chromedriver")
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    chromium = next(filter(None, map(shutil.which, names)), None)
    if not (driver and chromium):
        print("skipped: there is no " + " and no ".join(n for n, p in (("chromedriver", driver), ("Chromium", chromium)) if not p))
        raise SystemExit(SKIPPED)
    if shots:
        shots.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(driver, chromium, profile)
        try:
            look(browser, folder, shots)
        finally:
            browser.close()


main()
