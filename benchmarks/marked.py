"""Put a benchmark's figures into a page of the docs, between the marks that the page holds for them."""

from __future__ import annotations

from pathlib import Path

END = "<!-- end -->"


def put(document: Path, begin: str, text: str, end: str = END) -> None:
    """Replace what stands between `begin` and the next `end` of a page; ValueError where the page lacks a mark."""
    page = document.read_text(encoding="utf-8")
    start = page.index(begin) + len(begin)
    stop = page.index(end, start)
    document.write_text(f"{page[:start]}\n\n{text.strip()}\n\n{page[stop:]}", encoding="utf-8")
