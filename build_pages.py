"""Build the studio's pages (web/) into src/terragrip/studio/static, where Node.js 20 or newer and npm are present.

Without them, or without the npm registry, nothing is built and nothing fails: everything but the studio's pages works. Run alone it
exits 0 in either case and says what it did; `--required` makes a missing build an error.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent
WEB, STATIC = ROOT / "web", ROOT / "src" / "terragrip" / "studio" / "static"
OLDEST = 20


def build() -> str | None:
    """Build; None where it went well, else one line that says why not."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        return f"the studio's pages are not built: they need Node.js {OLDEST} or newer with npm"
    version = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout
    found = re.match(r"v(\d+)", version)
    if found is None or int(found.group(1)) < OLDEST:
        return f"the studio's pages are not built: Node.js {version.strip()} is older than {OLDEST}"
    for words in (["ci", "--no-audit", "--no-fund", "--loglevel=error"], ["run", "--silent", "build"]):
        done = subprocess.run([npm, *words], cwd=WEB, capture_output=True, text=True, check=False)
        if done.returncode:
            text = (done.stderr or done.stdout).strip().splitlines()
            return f"the studio's pages are not built: npm {words[0]} failed ({text[-1] if text else 'no message'})"
    (STATIC / "licences.txt").write_text(notices(WEB), encoding="utf-8")
    return None


def notices(web: Path) -> str:
    """The licence texts of the packages inside the pages, which most of them require to go with every copy."""
    lock = json.loads((web / "package-lock.json").read_text(encoding="utf-8"))
    parts = []
    for path, about in lock["packages"].items():
        if path and not about.get("dev"):
            title = f"{path.rpartition('node_modules/')[2]} {about['version']}: {about.get('license', 'see its source')}"
            texts = [
                file.read_text(encoding="utf-8", errors="replace").strip()
                for file in sorted((web / path).glob("*"))
                if re.match(r"(licen[cs]e|copying|notice)", file.name, re.IGNORECASE) and file.is_file()
            ]
            parts.append("\n\n".join([title, *texts]))
    return f"\n\n{'-' * 78}\n\n".join(parts) + "\n"


def stale() -> bool:
    """Whether the pages are missing or older than their sources."""
    page = STATIC / "index.html"
    if not page.is_file():
        return True
    sources = [
        WEB / "package-lock.json",
        WEB / "index.html",
        WEB / "vite.config.ts",
        *(WEB / "src").rglob("*"),
    ]
    return any(path.stat().st_mtime > page.stat().st_mtime for path in sources if path.is_file())


def main() -> int:
    if WEB.is_dir() and stale():
        problem = build()
        print(problem or "The studio's pages are built.", file=sys.stderr if problem else sys.stdout)
        return int(problem is not None and "--required" in sys.argv)
    return 0


if __name__ == "__main__":
    sys.exit(main())
