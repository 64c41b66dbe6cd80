"""A report page as PDF: the page's own HTML, printed by PlutoPrint, with fonts that come along.

matplotlib's DejaVu Sans is embedded, so the PDF reads alike on a machine without fonts (docs/decisions/0041).
"""

from __future__ import annotations

import base64
from pathlib import Path

from terragrip.errors import InputError
from terragrip.files import replacing
from terragrip.report.page import Page, render

EXTRA = "pip install 'terragrip[report]'"
_FONT = "Report Sans"
_FACES = (
    ("DejaVuSans.ttf", 400, "normal"),
    ("DejaVuSans-Bold.ttf", 700, "normal"),
    ("DejaVuSans-Oblique.ttf", 400, "italic"),
)


def pdf_possible() -> bool:
    """Whether the package that prints is installed."""
    from importlib.util import find_spec

    return find_spec("plutoprint") is not None


def write_pdf(page: Page, path: Path) -> Path:
    """Print `page` to `path`, whole or not at all. Raises InputError without the package, or where it cannot be written."""
    try:
        import plutoprint
    except ImportError:
        raise InputError("plutoprint is not installed, so there is no PDF", hint=EXTRA) from None
    html = render(page, print_css=_faces() + f'body, figure svg text {{ font-family: "{_FONT}"; }}')
    book = plutoprint.Book(plutoprint.PAGE_SIZE_A4, media=plutoprint.MEDIA_TYPE_PRINT)
    book.set_metadata(plutoprint.PDF_METADATA_TITLE, page.title)
    book.set_metadata(plutoprint.PDF_METADATA_CREATOR, "Terragrip")
    # A base that nothing is loaded from: links within the page need one to be complete.
    book.load_html(html, base_url="report:")
    with replacing(path) as temporary:
        book.write_to_pdf(str(temporary))
    return path


def _faces() -> str:
    """@font-face rules that hold matplotlib's own fonts."""
    import matplotlib as mpl

    folder = Path(mpl.get_data_path()) / "fonts" / "ttf"
    rules = []
    for file, weight, slant in _FACES:
        data = base64.b64encode((folder / file).read_bytes()).decode("ascii")
        rules.append(
            f'@font-face {{ font-family: "{_FONT}"; font-weight: {weight}; font-style: {slant}; '
            f"src: url(data:font/ttf;base64,{data}); }}\n"
        )
    return "".join(rules)
