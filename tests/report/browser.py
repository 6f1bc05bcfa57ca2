#!/usr/bin/env python3
"""Looks at a report in headless Chromium, as a person would.

    browser.py FOLDER [SCREENSHOTS]

Speaks WebDriver to `chromedriver` with nothing but the standard library. Prints one line for each check; exits with 1 at
the first that fails, with 77 where there is no browser. With a folder for screenshots it also writes what it saw, at
desktop, tablet and phone width, light and dark, and the page as it is printed.
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
        # The driver is on this machine, so no proxy is used.
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

    def part(self, box):
        """A picture of the part `box` of the window (left, top, width, height), taken when pending changes have been drawn."""
        self.run("return Promise.all([...document.querySelectorAll('.stage img')].map(image => image.decode()))")
        time.sleep(0.4)
        x, y = self.run("return [scrollX, scrollY]")
        # The clip leaves out the round corners.
        clip = {"x": box[0] + x + 5, "y": box[1] + y + 5, "width": box[2] - 10, "height": box[3] - 10, "scale": 1}
        return base64.b64decode(self.devtools("Page.captureScreenshot", format="png", clip=clip)["data"])

    def nameless(self):
        """Controls and pictures without an accessible name, by the browser's own computation of names: role and node of each."""
        roles = {"button", "link", "combobox", "slider", "textbox", "checkbox", "radio", "image", "img", "group", "table", "figure"}
        found = []
        for node in self.devtools("Accessibility.getFullAXTree")["nodes"]:
            role = node.get("role", {}).get("value", "")
            operated = role in roles - {"figure", "table", "group"} or any(
                one["name"] == "focusable" and one["value"].get("value") for one in node.get("properties", [])
            )
            named = node.get("name", {}).get("value", "").strip()
            if operated and not node.get("ignored") and not named and role not in ("RootWebArea", "generic"):
                found.append((role, node.get("backendDOMNodeId")))
        return found

    def close(self):
        if self.session:
            self.call("DELETE", self.session)
        self.server.terminate()
        self.server.wait(timeout=20)


# The rules of WCAG 2.2 that a program can check on this page. Returns the violations, in words.
ACCESSIBLE = r"""
const wrong = [];
const all = [...document.querySelectorAll('*')];
const shown = e => e.checkVisibility({opacityProperty: true, visibilityProperty: true}) && e.getBoundingClientRect().width > 0;
const tell = (what, e) => wrong.push(`${what}: ${e.outerHTML.slice(0, 120)}`);
if (!document.documentElement.lang) wrong.push('the language is not told (3.1.1)');
if (document.querySelectorAll('main').length !== 1) wrong.push('not one main part (1.3.1)');
const ids = all.map(e => e.id).filter(Boolean);
for (const id of ids.filter((id, at) => ids.indexOf(id) !== at)) wrong.push(`two elements are called ${id}`);
for (const e of all) {
  for (const name of ['aria-labelledby', 'aria-describedby', 'aria-controls', 'for'])
    for (const id of (e.getAttribute(name) || '').split(/\s+/).filter(Boolean))
      if (!document.getElementById(id)) tell(`${name} names nothing`, e);
  if (e.tabIndex > 0) tell('a place of its own in the order (2.4.3)', e);
}
let level = 0;
for (const e of document.querySelectorAll('h1, h2, h3, h4')) {
  const own = Number(e.tagName[1]);
  if (own > level + 1) tell('a heading skips a level (1.3.1)', e);
  level = own;
}
for (const e of document.images) if (!e.alt.trim()) tell('a picture without words (1.1.1)', e);
for (const e of document.querySelectorAll('svg')) if (!e.getAttribute('aria-label') && !e.getAttribute('aria-hidden')) tell('a drawing without words (1.1.1)', e);
for (const e of document.querySelectorAll('thead th')) if (e.textContent.trim() && !e.scope) tell('a header of nothing (1.3.1)', e);
for (const e of document.querySelectorAll('button, select, input')) {
  const r = e.getBoundingClientRect();
  if (shown(e) && !e.closest('thead') && (r.width < 24 || r.height < 24)) tell('a target too small (2.5.8)', e);
}
for (const e of all) {
  const style = getComputedStyle(e);
  const scrolls = /auto|scroll/.test(style.overflowX + style.overflowY) && (e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 1);
  if (scrolls && shown(e) && e !== document.documentElement && e !== document.body && e.tabIndex < 0) tell('scrolls, and not by keys (2.1.1)', e);
}
const channels = color => (color.match(/[\d.]+/g) || []).map(Number);
const luminance = color => {
  const [r, g, b] = channels(color).map(v => { v /= 255; return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4 });
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const ground = e => {
  for (; e; e = e.parentElement) {
    const color = getComputedStyle(e).backgroundColor, alpha = channels(color)[3];
    if (alpha === undefined || alpha > 0.99) return color;
  }
  return 'rgb(255, 255, 255)';
};
const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walk.nextNode()) {
  const e = walk.currentNode.parentElement;
  if (!walk.currentNode.data.trim() || ['SCRIPT', 'STYLE', 'OPTION'].includes(e.tagName) || !shown(e)) continue;
  const style = getComputedStyle(e), drawn = e.namespaceURI.endsWith('svg');
  const [a, b] = [luminance(drawn ? style.fill : style.color), luminance(ground(e))];
  const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  const size = parseFloat(style.fontSize), large = size >= 24 || size >= 18.66 && style.fontWeight >= 700;
  if (contrast < (large ? 3 : 4.5)) tell(`contrast ${contrast.toFixed(2)} (1.4.3)`, e);
}
return wrong;
"""


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

    slider = "const box = document.querySelector('.compare'); const range = box && box.querySelector('.divider');"
    choose = (
        "const pick = (name, value) => { const s = box.querySelector(name); s.value = value;"
        "s.dispatchEvent(new Event('change', {bubbles: true})); s.dispatchEvent(new Event('input', {bubbles: true})) };"
    )
    natural = browser.run(slider + "return [box.dataset.zoom, box.querySelector('.over').getBoundingClientRect().width, box.querySelector('.over').naturalWidth]")
    check("pictures are shown as they were measured", natural[0] == "1" and natural[1] == natural[2], natural)
    browser.run(slider + choose + "pick('.zoom', 'fit')")
    check("there is a slider", browser.run(slider + "return Boolean(range) && !box.hidden"))
    clip = slider + "return getComputedStyle(box.querySelector('.over')).clipPath"
    # The page scrolls smoothly: positions measured during a scroll would be wrong.
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

    wide = "return box.querySelector('.over').getBoundingClientRect().width / box.querySelector('.over').naturalWidth"
    for zoom in (1, 2, 4, 8):
        found = browser.run(slider + choose + f"pick('.zoom', '{zoom}');" + wide)
        check(f"at zoom {zoom} a pixel is {zoom} pixels wide", found == zoom, found)
    sharp = slider + "return getComputedStyle(box.querySelector('.over')).imageRendering"
    check("pixels are not blurred", browser.run(sharp) == "pixelated", browser.run(sharp))
    browser.run(slider + choose + "pick('.zoom', '1'); pick('.mode', 'difference'); box.querySelectorAll('select')[0].value = box.querySelectorAll('select')[1].value; box.querySelectorAll('select')[0].dispatchEvent(new Event('change'))")
    browser.run(slider + "box.querySelector('.stage').scrollIntoView({behavior: 'instant', block: 'center'})")
    part = "const r = box.querySelector('.stage').getBoundingClientRect(); return [r.left, r.top, r.width, r.height]"
    # The browser may draw loaded pictures with a delay, so this is tried several times.
    for _ in range(10):
        browser.run(slider + choose + "pick('.exposure', '0')")
        black = browser.part(browser.run(slider + part))
        browser.run(slider + choose + "pick('.exposure', '6')")
        bright = browser.part(browser.run(slider + part))
        if black == bright:
            break
    check("a picture does not differ from itself, however bright", black == bright)
    browser.run(slider + choose + "box.querySelectorAll('select')[0].selectedIndex = 0; box.querySelectorAll('select')[0].dispatchEvent(new Event('change'))")
    differs = browser.part(browser.run(slider + part))
    check("raster differs from its reference", differs != black)
    browser.run(slider + choose + "pick('.exposure', '0')")
    check("exposure changes what is seen", browser.part(browser.run(slider + part)) != differs)
    browser.run(slider + choose + "pick('.mode', 'flicker')")
    away = slider + "return box.querySelector('.over').classList.contains('away')"
    seen = {browser.run(away) for _ in range(20) if not time.sleep(0.1)}
    check("flicker shows the two pictures in turns", seen == {True, False}, seen)
    browser.run(slider + "box.querySelector('.swap').click()")
    stopped = {browser.run(away) for _ in range(8) if not time.sleep(0.2)}
    check("the button stops it", len(stopped) == 1, stopped)
    browser.run(slider + choose + "pick('.zoom', 'fit'); pick('.mode', 'divider')")

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

    # The answer is visible without scrolling: every effect with its verdict.
    browser.run("window.scrollTo({top: 0, behavior: 'instant'})")
    last = (
        "const rows = document.querySelector('.short table').tBodies[0].rows; const cell = rows[rows.length - 1].cells[1];"
        "const box = cell.getBoundingClientRect(); return [rows.length, box.right, box.bottom]"
    )
    for width, height in ((1280, 800), (390, 844)):
        browser.size(width, height, width < 600)
        count, right, bottom = browser.run(last)
        seen_at_once = count == 5 and right <= width and bottom <= height
        check(f"the verdicts are seen at once at {width} x {height}", seen_at_once, (count, right, bottom))

    overflow = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
    for width in (1280, 768, 390, 360):
        browser.size(width, 800, width < 600)
        check(f"no sideways scrolling at {width} pixels", browser.run(overflow) <= 0, browser.run(overflow))
    browser.size(390, 844, True)
    cut = (
        "return [...document.querySelectorAll('table td, table tbody th')].filter(cell => {"
        "const r = cell.getBoundingClientRect(); return r.width > 0 && (r.left < 0 || r.right > innerWidth + 0.5) })"
        ".map(cell => cell.textContent).slice(0, 5)"
    )
    check("every cell of every table is in a window of 390 pixels", browser.run(cut) == [], browser.run(cut))
    for width in (1280, 768, 390):
        browser.size(width, 844, width < 600)
        for scheme in ("light", "dark"):
            browser.scheme(scheme)
            wrong = browser.run(ACCESSIBLE)
            check(f"nothing is in the way of anybody at {width} pixels, {scheme}", wrong == [], wrong[:8])
        nameless = browser.nameless()
        check(f"every control has a name at {width} pixels", nameless == [], nameless[:8])
    browser.scheme("light")

    ground = "return getComputedStyle(document.body).backgroundColor"
    axis = "return getComputedStyle(document.querySelector('.plot svg text')).fill"
    seen = {}
    for scheme in ("light", "dark"):
        browser.scheme(scheme)
        seen[scheme] = (browser.run(ground), browser.run(axis))
        if shots:
            for name, width in (("desktop", 1280), ("tablet", 768), ("phone", 390)):
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
        # The browser's own start page makes requests too.
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
