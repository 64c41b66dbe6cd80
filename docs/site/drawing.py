"""The drawing of axes and signs: a machine from its right side, driving to the right; the text of an SVG."""

from __future__ import annotations

import math

WIDTH, HEIGHT = 820, 470
INK, FORCE, TURN, GROUND = "#1b1b1b", "#0072b2", "#b04a00", "#8a7350"
_RADIUS = 52


def axes() -> str:
    """An SVG that names the channels where they act, each arrow in its positive direction."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}"'
        ' font-family="sans-serif" font-size="13" role="img">',
        "<title>Axes and positive directions of the channels, seen from the machine's right side</title>",
        _heads(),
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#ffffff"/>',
        *_machine(),
        *_forces(),
        *_turns(),
        *_frame(),
        *_slip_scale(),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _heads() -> str:
    marks = [
        f'<marker id="{name}" viewBox="0 0 10 10" refX="8" refY="5" markerWidth="7" markerHeight="7" orient="auto-start-reverse">'
        f'<path d="M0 0 10 5 0 10z" fill="{colour}"/></marker>'
        for name, colour in (("ink", INK), ("force", FORCE), ("turn", TURN))
    ]
    return f"<defs>{''.join(marks)}</defs>"


def _line(x1: float, y1: float, x2: float, y2: float, kind: str = "ink", width: float = 2) -> str:
    colour = {"ink": INK, "force": FORCE, "turn": TURN}[kind]
    return f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{colour}" stroke-width="{width}" marker-end="url(#{kind})"/>'


def _text(x: float, y: float, text: str, kind: str = "ink", anchor: str = "start", size: int = 13) -> str:
    colour = {"ink": INK, "force": FORCE, "turn": TURN, "ground": GROUND}[kind]
    return f'<text x="{x}" y="{y}" fill="{colour}" text-anchor="{anchor}" font-size="{size}">{text}</text>'


def _arc(x: float, y: float, radius: float, start: float, stop: float, kind: str = "turn") -> str:
    """An arrow on a circle, from one angle to another [deg, counter-clockwise from the right]."""
    a, b = (
        (x + radius * math.cos(math.radians(v)), y - radius * math.sin(math.radians(v)))
        for v in (start, stop)
    )
    sweep, large = int(stop < start), int(abs(stop - start) > 180)
    colour = TURN if kind == "turn" else INK
    return (
        f'<path d="M{a[0]:.1f} {a[1]:.1f} A{radius} {radius} 0 {large} {sweep} {b[0]:.1f} {b[1]:.1f}" fill="none"'
        f' stroke="{colour}" stroke-width="2" marker-end="url(#{kind})"/>'
    )


def _machine() -> list[str]:
    wheels = [
        f'<circle cx="{x}" cy="248" r="{_RADIUS}" fill="#e9e9e9" stroke="{INK}" stroke-width="2"/>'
        f'<circle cx="{x}" cy="248" r="4" fill="{INK}"/>'
        for x in (300, 500)
    ]
    return [
        f'<line x1="30" y1="300" x2="790" y2="300" stroke="{GROUND}" stroke-width="3"/>',
        f'<rect x="250" y="150" width="300" height="72" rx="10" fill="#f5f5f5" stroke="{INK}" stroke-width="2"/>',
        f'<rect x="60" y="225" width="110" height="73" fill="none" stroke="{INK}" stroke-dasharray="5 4"/>',
        _text(115, 268, "tool", anchor="middle"),
        f'<line x1="170" y1="235" x2="250" y2="210" stroke="{INK}" stroke-width="3"/>',
        *wheels,
        _text(300, 186, "rear axle", anchor="middle"),
        _text(500, 186, "front axle", anchor="middle"),
    ]


def _forces() -> list[str]:
    return [
        _line(245, 200, 150, 200, "force", 3),
        _text(60, 182, "drawbar_force", "force"),
        _text(60, 166, "N, the tool pulls backward: +", "force", size=12),
        _line(560, 165, 650, 165, "ink", 3),
        _text(568, 152, "ground_speed"),
        _text(658, 169, "m/s, forward: +", size=12),
        _line(500, 345, 500, 306, "force", 3),
        _text(512, 340, "vertical_load_front", "force"),
        _text(512, 356, "N, the ground carries: +", "force", size=12),
        _line(290, 322, 350, 322, "force", 3),
        _text(290, 343, "wheel_force_x_*", "force"),
        _text(290, 359, "N, the ground pushes forward: +", "force", size=12),
    ]


def _turns() -> list[str]:
    return [
        _arc(500, 248, 36, 150, 30),
        _text(560, 240, "wheel_speed_*", "turn"),
        _text(560, 256, "rad/s, rolling forward: +", "turn", size=12),
        _text(560, 274, "drive_torque_*", "turn"),
        _text(560, 290, "N m at the wheel, driving forward: +", "turn", size=12),
        _arc(400, 190, 120, 40, 75),
        _text(440, 62, "pitch", "turn"),
        _text(478, 62, "rad, nose up: +", "turn", size=12),
    ]


def _frame() -> list[str]:
    """The body's axes: x forward, y left (into the page, seen from the right), z up."""
    x, y = 110, 110
    return [
        _line(x, y, x + 62, y),
        _text(x + 68, y + 5, "x forward"),
        _line(x, y, x, y - 62),
        _text(x - 12, y - 70, "z up"),
        f'<circle cx="{x}" cy="{y}" r="7" fill="#ffffff" stroke="{INK}" stroke-width="2"/>',
        f'<path d="M{x - 5} {y - 5}l10 10m0-10l-10 10" stroke="{INK}" stroke-width="2"/>',
        _text(x - 14, y + 24, "y left, away from you", size=12),
        _text(235, 30, "acceleration_x, _y, _z: specific force, at rest z reads +9.81 m/s²", size=12),
        _text(560, 84, "angular_velocity_z: turning left +", size=12),
        _text(560, 102, "roll: left side up +", size=12),
    ]


def _slip_scale() -> list[str]:
    y, left, right = 420, 130, 690
    middle = (left + right) / 2
    parts = [
        f'<line x1="{left}" y1="{y}" x2="{right}" y2="{y}" stroke="{INK}" stroke-width="2"/>',
        _text(left - 24, y + 5, "slip", "ink", "end"),
    ]
    for x, value, word in (
        (left, "−1", "locked, sliding"),
        ((left + middle) / 2, "", "braking: the ground turns the wheel"),
        (middle, "0", "rolling freely"),
        ((middle + right) / 2, "", "driving: the rim is faster than the ground"),
        (right, "1", "spinning on the spot"),
    ):
        if value:
            parts.append(
                f'<line x1="{x}" y1="{y - 6}" x2="{x}" y2="{y + 6}" stroke="{INK}" stroke-width="2"/>'
            )
            parts.append(_text(x, y - 12, value, "ink", "middle"))
        parts.append(_text(x, y + (22 if value else 40), word, "ink", "middle", 12))
    return parts
