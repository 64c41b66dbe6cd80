"""The filters in plain NumPy: slow, readable, for any model of one's own, and what the oracle of the C kernel is made of.

    from terragrip.estimation.reference import UnscentedKalmanFilter, runge_kutta

    f = runge_kutta(lambda x, u: np.array([x[1], u - 0.3 * x[1] ** 2]))  # dx/dt
    Q = lambda dt: 1e-3 * dt * np.eye(2)
    ukf = UnscentedKalmanFilter(f, lambda x: x[:1], Q, R=[[0.01]], x0=[0, 0], P0=np.eye(2))
    ukf.step(y=[0.2], u=1.0, dt=0.1)

The equations are the paper's (Kobelski, Osinenko, Streif 2021, "Adaptive Unscented Kalman filter") with the
corrections of physics.md 6. Any filter can be made adaptive (:class:`AdaptiveFilter`) or stand in a
:class:`Bank`. `tests/estimation/kernel_twin` puts the parts together as the kernel does.
"""

from terragrip.estimation.reference.adaptation import Adaptation, AdaptiveFilter
from terragrip.estimation.reference.bank import Bank, BankUpdate
from terragrip.estimation.reference.filters import (
    ExtendedKalmanFilter,
    GaussianFilter,
    KalmanFilter,
    Observation,
    Prediction,
    Update,
    runge_kutta,
)
from terragrip.estimation.reference.smoother import smooth
from terragrip.estimation.reference.unscented import UnscentedKalmanFilter

__all__ = [
    "KalmanFilter",
    "ExtendedKalmanFilter",
    "UnscentedKalmanFilter",
    "GaussianFilter",
    "Prediction",
    "Observation",
    "Update",
    "runge_kutta",
    "Adaptation",
    "AdaptiveFilter",
    "Bank",
    "BankUpdate",
    "smooth",
]
