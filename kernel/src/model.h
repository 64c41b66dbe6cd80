/* The motion and the channels of physics.md 1 for an engine that knows nothing of their structure. Inlined: the wheel count is a
 * constant. */
#ifndef TG_MODEL_H
#define TG_MODEL_H
#include "filter.h"

/* d/dt of (v, omega_1..omega_n) at the state x in row order, inputs held, but for the bearings' drag: paper eq. 3 and 2, with a slope. It
 * is the same all over a step, since mu and rho_s stay. */
TG_INLINE void model_rates(const tg_filter *f, const tg_input *u, tg_real cosine, tg_real sine, const tg_real *x, tg_real *rate, const int n)
{
    const tg_real *const mu = x, rho = x[n];
    tg_real traction = 0;
    for (int i = 0; i < n; i++) {
        rate[1 + i] = u->torque[i] * f->inverse_inertia[i] - (mu[i] + f->machine.tire_rolling_resistance) * u->load[i] * f->arm[i];
        traction += mu[i] * u->load[i];
    }
    rate[0] = (traction - u->drawbar - rho * u->hitch_load) * tgi_inverse_mass(f, u) - f->machine.gravity * (rho * cosine + sine);
}

/* One step of the state (paper eq. 9) by Runge-Kutta 4 in equal substeps; mu and rho_s stay, so that v gains alike in every stage. */
TG_INLINE void model_move(const tg_filter *f, const tgi_plan *plan, tg_real *x, const int n)
{
    const tg_real h = plan->passage.dt / (tg_real)plan->substeps;
    tg_real rate[TG_MAX_WHEELS + 1], *const omega = x + n + 2;
    model_rates(f, plan->before, plan->cosine[0], plan->sine[0], x, rate, n);
    x[n + 1] += plan->passage.dt * rate[0];
    for (int32_t step = 0; step < plan->substeps; step++)
        for (int i = 0; i < n; i++) {
            const tg_real k1 = rate[1 + i] - omega[i] * f->drag[i];
            const tg_real k2 = rate[1 + i] - (omega[i] + h / 2 * k1) * f->drag[i];
            const tg_real k3 = rate[1 + i] - (omega[i] + h / 2 * k2) * f->drag[i];
            const tg_real k4 = rate[1 + i] - (omega[i] + h * k3) * f->drag[i];
            omega[i] += h / 6 * (k1 + 2 * (k2 + k3) + k4);
        }
}

/* What the channels should read at x (paper eq. 9): v, omega_1..omega_n, a_x. */
TG_INLINE void model_channels(const tgi_plan *plan, const tg_real *x, tg_real *y, const int n)
{
    for (int o = 0; o <= n; o++) y[o] = x[n + 1 + o];
    y[n + 1] = plan->accelerometer_shift;
    for (int i = 0; i <= n; i++) y[n + 1] += plan->accelerometer[i] * x[i];
}
#endif
