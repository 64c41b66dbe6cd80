/* The motion and the channels of physics.md 1 for an engine that knows nothing of their structure. Inlined: the wheel count is a constant. */
#ifndef TG_MODEL_H
#define TG_MODEL_H
#include "filter.h"

/* d/dt of (v, omega_1..omega_n) at the state x in row order, inputs held: paper eq. 3 and 2, with a slope. */
TG_INLINE void model_rates(const tg_filter *f, const tg_input *u, tg_real cosine, tg_real sine, const tg_real *x, tg_real *rate, const int n)
{
    const tg_real *const mu = x, rho = x[n], *const omega = x + n + 2;
    tg_real traction = 0;
    for (int i = 0; i < n; i++) {
        rate[1 + i] = u->torque[i] * f->inverse_inertia[i] -
                      (mu[i] + f->machine.tire_rolling_resistance) * u->load[i] * f->arm[i] - omega[i] * f->drag[i];
        traction += mu[i] * u->load[i];
    }
    rate[0] = (traction - u->drawbar) * f->inverse_mass - f->machine.gravity * (rho * cosine + sine);
}

/* One step of the state (paper eq. 9) by Runge-Kutta 4 in equal substeps; mu and rho_s stay. */
TG_INLINE void model_move(const tg_filter *f, const tgi_plan *plan, tg_real *x, const int n)
{
    const tg_real h = plan->passage.dt / (tg_real)plan->substeps;
    tg_real z[TG_ROWS], k1[TG_MAX_WHEELS + 1], k2[TG_MAX_WHEELS + 1], k3[TG_MAX_WHEELS + 1], k4[TG_MAX_WHEELS + 1];
    for (int i = 0; i <= n; i++) z[i] = x[i];
    for (int32_t step = 0; step < plan->substeps; step++) {
        model_rates(f, plan->before, plan->cosine[0], plan->sine[0], x, k1, n);
        for (int o = 0; o <= n; o++) z[n + 1 + o] = x[n + 1 + o] + h / 2 * k1[o];
        model_rates(f, plan->before, plan->cosine[0], plan->sine[0], z, k2, n);
        for (int o = 0; o <= n; o++) z[n + 1 + o] = x[n + 1 + o] + h / 2 * k2[o];
        model_rates(f, plan->before, plan->cosine[0], plan->sine[0], z, k3, n);
        for (int o = 0; o <= n; o++) z[n + 1 + o] = x[n + 1 + o] + h * k3[o];
        model_rates(f, plan->before, plan->cosine[0], plan->sine[0], z, k4, n);
        for (int o = 0; o <= n; o++) x[n + 1 + o] += h / 6 * (k1[o] + 2 * (k2[o] + k3[o]) + k4[o]);
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
