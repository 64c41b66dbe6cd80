"""``terragrip doctor``: what this installation can do, and what it lacks."""

from __future__ import annotations

import typer

_MARK = {"ok": "ok", "note": "-", "fix": "FIX", "defect": "DEFECT"}


def command() -> None:
    """Check this installation.

    Checks versions, extras, the kernel against a known answer, the studio's pages and port, browser and permissions. Exit code 0: it works
    (optional parts may be absent); 2: a line marked FIX needs your action; 1: the kernel computes wrongly.
    """
    from terragrip.doctor import findings

    states = set()
    for finding in findings():
        states.add(finding.state)
        print(f"{_MARK[finding.state]:<6} {finding.subject:<10} {finding.text}")
    code = 1 if "defect" in states else 2 if "fix" in states else 0
    if code:
        wrong = (
            "the kernel computes wrongly; please report this list" if code == 1 else "see the lines FIX above"
        )
        typer.echo(f"terragrip: doctor: {wrong}", err=True)
        raise typer.Exit(code)
