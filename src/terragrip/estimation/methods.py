"""The named methods: an engine and a noise policy each (methods.md)."""

from __future__ import annotations

from dataclasses import dataclass

from terragrip.errors import InputError, suggestion

# Values of tg_engine, tg_policy and tg_method in kernel/include/terragrip.h.
EXACT, UNSCENTED = 0, 1
FIXED, ADAPTIVE, SUPERVISED, BANK = 0, 1, 2, 3
FILTERED, ALGEBRAIC, SPEEDS = 0, 1, 2


@dataclass(frozen=True)
class Method:
    """An estimation method. ``kind`` is tg_method, ``engine`` tg_engine, ``policy`` tg_policy of the kernel; ``supervisor`` is the
    input of the fuzzy supervisor: 0 the wheel and ground speeds (paper), 1 drive torque and slip."""

    name: str
    meaning: str
    kind: int = FILTERED
    engine: int = EXACT
    policy: int = FIXED
    supervisor: int = 0

    @property
    def can_smooth(self) -> bool:
        """Whether a backward pass exists: it needs a filter."""
        return self.kind in (FILTERED, SPEEDS)

    @property
    def adapts(self) -> bool:
        """Whether it adapts its process noise by factors A_k."""
        return self.kind == FILTERED and self.policy in (ADAPTIVE, SUPERVISED)


METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method("algebraic", "the equations of motion on low-passed signals, no filter", kind=ALGEBRAIC),
        # The model is affine in the state, so the extended Kalman filter is the Kalman filter (physics.md 1).
        Method("ekf", "extended Kalman filter; on this model the same as kalman"),
        Method("ukf", "unscented Kalman filter, fixed noise", engine=UNSCENTED),
        Method("aukf", "adaptive unscented Kalman filter", engine=UNSCENTED, policy=ADAPTIVE),
        Method(
            "aukf-fs",
            "adaptive unscented, fuzzy supervisor: the paper's",
            engine=UNSCENTED,
            policy=SUPERVISED,
        ),
        Method(
            "aukf-fs-drive",
            "the same, supervised by drive torque and slip: for wheels under speed control",
            engine=UNSCENTED,
            policy=SUPERVISED,
            supervisor=1,
        ),
        Method("kalman", "exact Kalman filter, fixed noise"),
        Method("bank", "four exact filters over the scale of the noise, mixed as an IMM", policy=BANK),
    )
}
DEFAULT = "bank"

SLIP_ONLY = Method(
    "slip-only", "slip from speeds, where no torque is measured; chosen automatically", kind=SPEEDS
)
"""Not one of `METHODS`: the channels of the log decide."""


def method_named(name: str, *, smooth: bool = False) -> Method:
    """The method of that name; raises InputError, which names the nearest one, or if it cannot ``smooth``."""
    name = str(name)
    if name in METHODS:
        if smooth and not METHODS[name].can_smooth:
            hint = "use another method, or leave out smooth"
            raise InputError(f"the method {name} cannot smooth", hint=hint)
        return METHODS[name]
    near = suggestion(name, METHODS, f"choose one of {', '.join(METHODS)}")
    raise InputError(f"there is no method {name!r}", hint=near)
