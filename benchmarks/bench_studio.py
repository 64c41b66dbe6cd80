"""The studio: first paint, slider redraws, live updates, the server's share of a core, the size of the front end.

Issue 6: first paint under 1 s on loopback, 50 redraws a second while a slider moves, 45 live updates a second at 100 Hz with six
traces, the server under 5 % of a core with one live viewer, the front end under 450 kB compressed. The peer in the same run is an
empty page in the same browser: its first paint and its animation frames are what the machine can do.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from studio_session import browser, fill, studio

STATIC = Path(__file__).parents[1] / "src" / "terragrip" / "studio" / "static"
PAINT = "() => performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN"
FRAMES = """async () => {
  let n = 0; const begin = performance.now();
  await new Promise((done) => {
    const step = () => { n++; performance.now() - begin < 2000 ? requestAnimationFrame(step) : done(); };
    step();
  });
  return (1000 * n) / (performance.now() - begin);
}"""
SLIDER = """async () => {
  const { plot } = window.terragripFit, slider = document.getElementById("slider-a");
  const before = plot.redraws, begin = performance.now(); let i = 0;
  await new Promise((done) => {
    const move = () => {
      slider.value = String(0.3 + 0.014 * (i++ % 50));
      slider.dispatchEvent(new Event("input"));
      performance.now() - begin < 3000 ? requestAnimationFrame(move) : done();
    };
    move();
  });
  return (1000 * (plot.redraws - before)) / (performance.now() - begin);
}"""


def processor_seconds(process: int) -> float:
    """User and system time of a process so far [s] (Linux)."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(") ", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def compressed() -> tuple[int, int]:
    """Bytes of the front end as sent, without and with the map (brotli where it was made, else as it is)."""
    sizes = {}
    for path in STATIC.rglob("*"):
        if path.is_file() and path.suffix not in (".br", ".gz"):
            packed = path.with_name(path.name + ".br")
            sizes[path.name] = (packed if packed.is_file() else path).stat().st_size
    total = sum(sizes.values())
    largest = max((n for n in sizes if n.startswith("page-") and n.endswith(".js")), key=lambda n: sizes[n])
    of_map = sum(size for name, size in sizes.items() if "maplibre" in name or name == largest)
    return total - of_map, total


def main() -> int:
    figures: list[tuple[str, float, str, str]] = []
    with tempfile.TemporaryDirectory() as folder, browser() as chromium:
        fill(Path(folder))
        run = next(Path(folder).glob("*-estimates.parquet")).name
        with studio(Path(folder)) as (url, process):
            page: Any = chromium.new_page(viewport={"width": 1280, "height": 720})
            page.goto("data:text/html,<p>empty")
            page.wait_for_timeout(300)
            empty, frames = page.evaluate(PAINT), page.evaluate(FRAMES)
            page.goto(url)
            page.wait_for_selector("h1")
            page.wait_for_timeout(300)
            paint = page.evaluate(PAINT)
            figures.append(("first paint [ms]", paint, f"{paint / empty:.1f} x an empty page", "< 1000"))
            page.goto(f"{url}#/fit?path={run}")
            page.wait_for_selector("#soil-list li")
            redraws = page.evaluate(SLIDER)
            figures.append(
                ("slider redraws [1/s]", redraws, f"{redraws / frames:.2f} of the browser's frames", ">= 50")
            )
            page.goto(f"{url}#/live?replay={run}")
            page.wait_for_function("() => window.terragripLive?.feed.ring.taken > 300")
            before, begin = processor_seconds(process), time.monotonic()
            first = page.evaluate(
                "() => [window.terragripLive.feed.messages, window.terragripLive.traces.redraws]"
            )
            page.wait_for_timeout(10_000)
            last = page.evaluate(
                "() => [window.terragripLive.feed.messages, window.terragripLive.traces.redraws]"
            )
            passed = time.monotonic() - begin
            share = (processor_seconds(process) - before) / passed
            updates = (last[0] - first[0]) / passed
            drawn = (last[1] - first[1]) / passed
            figures.append(
                (
                    "live updates [1/s]",
                    updates,
                    f"{drawn:.0f} drawn; {drawn / frames:.2f} of the frames",
                    ">= 45",
                )
            )
            figures.append(("server, one live viewer [% of a core]", 100 * share, "", "< 5"))
    without, total = compressed()
    figures.append(("front end without the map [kB]", without / 1e3, "", ""))
    figures.append(("front end whole [kB]", total / 1e3, "brotli", "< 450"))
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for name, value, more, target in figures:
        print(f"{name:40s} {value:8.1f}  {target:8s} {more}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
