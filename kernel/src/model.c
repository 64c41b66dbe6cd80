/* The motion of PHYSICS 1 as a rate of change, for engines that know nothing of its structure. */
#include "filter.h"

/* d/dt of (omega, v) in row order, with the inputs `u` held (paper eq. 1-3 with a slope); mu and rho_s are constant. */
void tgi_rates(const tg_machine *m, const tg_input *u, tg_real cosine, tg_real sine, const tg_real *x, tg_real *rate)
{
    const int n = m->wheels;
    const tg_real *const mu = x, rho = x[n], *const omega = x + n + 2;
    tg_real traction = 0;
    for (int i = 0; i < n; i++) {
        const tg_real r = m->radius[i], load = u->load[i];
        rate[i + 1] = (u->torque[i] - r * mu[i] * load - r * m->tire_rolling_resistance * load - r * m->bearing_resistance[i] * omega[i]) /
                      m->inertia[i];
        traction += mu[i] * load;
    }
    rate[0] = (traction - u->drawbar) / m->mass - m->gravity * (rho * cosine + sine);
}
