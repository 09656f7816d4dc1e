"""The report in a browser: nothing goes wrong in it, and what people press works."""

import json
import re
import shutil
import subprocess
from collections.abc import Mapping
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from agents.evaluation.report.page import write_report
from tests.support.written_results import HOSTILE, write_results, write_three

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

WATCH = """<script>
const wrong = [];
window.onerror = message => { wrong.push(String(message)); };
console.error = console.warn = (...words) => { wrong.push(words.join(" ")); };
window.alert = () => { wrong.push("a name ran as a script"); };
document.addEventListener("securitypolicyviolation", e => wrong.push(e.violatedDirective));
</script>"""
ACTS = """
const cells = column => [...document.querySelectorAll("#table tbody tr:has(td)")].map(
  row => row.cells[column].firstChild.textContent);
const told = { title: document.title, before: cells(2), paired: paired_rows() };
function paired_rows() { return document.querySelectorAll("#pairs tbody tr:has(td)").length; }
const press = key => document.getElementById("list").dispatchEvent(
  new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
const chosen = () => document.getElementById("shown").textContent;
const sort = column => document.querySelectorAll("#table thead button")[column].click();
told.groups = [...document.querySelectorAll("#table tbody th")].map(th => th.textContent);
sort(2);
told.upwards = cells(2);
sort(1);
told.success = cells(1);
sort(3);
told.gaps = cells(3);
told.shown = [chosen()];
for (const key of ["ArrowDown", "ArrowRight", "End", "ArrowDown", "ArrowLeft", "Home"]) {
  press(key);
  told.shown.push(chosen());
}
told.listed = {};
const filter = document.getElementById("filter");
for (const option of filter.options) {
  filter.value = option.value;
  filter.dispatchEvent(new Event("change"));
  told.listed[option.value] = document.querySelectorAll("#list [role=option]").length;
}
told.largest = chosen();
told.drawn = {
  discs: document.querySelectorAll("#drawing circle.around").length,
  paths: document.querySelectorAll("#drawing path.path:not(.cross)").length,
  shortest: document.querySelectorAll("#drawing path.dotted").length,
  profiles: document.querySelectorAll("#profile path").length,
};
document.querySelector("#legend button").click();
told.hidden = document.querySelectorAll("#profile path").length;
"""
TELL = """
told.images = document.images.length;
told.width = [innerWidth, document.documentElement.scrollWidth];
told.wrong = wrong;
const result = parent.document.createElement("pre");
result.id = "result";
result.textContent = JSON.stringify(told);
parent.document.body.append(result);
"""


def tried(directory: Path, width: int, acts: str) -> dict[str, Any]:
    """What happens when somebody uses the report in Chromium, in a window of that width."""
    report = (directory / "report.html").read_text(encoding="utf-8")
    report = report.replace("<head>", f"<head>{WATCH}")
    report = report.replace("</body>", f"<script>{acts}{TELL}</script></body>")
    (directory / "tried.html").write_text(report, encoding="utf-8")
    frame = f"<iframe src='tried.html' style='border:0;width:{width}px;height:844px'></iframe>"
    (directory / "frame.html").write_text(f"<body>{frame}", encoding="utf-8")
    done = subprocess.run(
        [
            str(CHROMIUM),
            "--headless",
            "--hide-scrollbars",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--allow-file-access-from-files",
            f"--user-data-dir={directory / 'browser'}",
            "--window-size=1280,900",
            "--virtual-time-budget=2000",
            "--dump-dom",
            (directory / "frame.html").as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    found = re.search(r'<pre id="result">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found is not None, done.stdout[:2000]
    told: dict[str, Any] = json.loads(unescape(found[1]))
    return told


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
@pytest.mark.parametrize("width", [390, 1200])
def test_a_report_works_in_a_browser(tmp_path: Path, width: int) -> None:
    three = write_three(tmp_path / "three")
    write_report(three)
    told = tried(three, width, ACTS)
    assert told["wrong"] == []
    assert told["images"] == 0
    assert told["title"] == "3 policies on 4 fields"
    assert told["width"] == [width, width]
    assert told["before"] == sorted(told["before"], reverse=True)
    assert told["upwards"] == told["before"][::-1]
    assert told["success"] == ["100.0", "75.0", "25.0"]
    assert told["gaps"] == ["3.57", "7.14", "∞"]
    assert told["paired"] == 2
    assert told["groups"] == ["?does not say what it knows"]
    a, b, c, last = "standard/train:1", "standard/train:0", "standard/train:2", HOSTILE
    assert told["shown"] == [a, b, c, last, last, c, a]
    assert told["listed"] == {"all": 4, "failures": 3, "0": 0, "1": 1, "2": 3, "gap": 4}
    assert told["largest"] == c
    assert told["drawn"] == {"discs": 50, "paths": 3, "shortest": 1, "profiles": 3}
    assert told["hidden"] == 2


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
@pytest.mark.parametrize("lengths", [{}, {"a": {"x": [None, 150.0]}}])
def test_reports_of_little_work_in_a_browser(tmp_path: Path, lengths: Mapping[str, Any]) -> None:
    write_report(write_results(tmp_path, lengths))
    told = tried(tmp_path, 390, "const told = {};")
    assert told["wrong"] == []
    assert told["width"] == [390, 390]
