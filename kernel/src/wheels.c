/* Wheel speeds between their samples (R; docs/decisions/0026-slow-wheel-speeds.md). A wheel's slip settles within milliseconds, so that its
 * speed changes as slowly as the vehicle's, while a torque's noise, or an old torque, integrated over the time between would make it run
 * away. There the last sample is used for the speed, and the adhesion follows the torque. */
#include "estimator.h"

/* Give the row the speeds of wheels that it does not measure; `dt` 0: none. All rows until the next sample share one error, and so
 * count as one measurement together. */
void tgi_hold_wheels(tg_estimator *e, tg_real dt, tg_row *row)
{
    const int32_t n = e->settings.machine.wheels;
    for (int32_t i = 0; i < n; i++) e->sparse_wheels |= isnan(row->value[TG_WHEEL_SPEED + i]);
    if (!e->sparse_wheels) return;
    for (int32_t i = 0; i < n; i++) {
        const tg_hold *const h = &e->wheel[i];
        const tg_real noise = e->settings.noise[TG_WHEEL_SPEED + i], x = row->value[TG_WHEEL_SPEED + i];
        const tg_real age = (tg_real)(row->time - h->time);
        if (!isnan(x) || h->count < 2 || h->spike > 0 || age > e->settings.tuned.wheel_late * h->interval || !(dt > 0)) continue;
        row->value[TG_WHEEL_SPEED + i] = h->raw;
        row->wheel_variance[i] = (noise * noise + tgi_motion(h, noise) * age / h->interval) * (h->interval / dt > 1 ? h->interval / dt : 1);
        row->held_wheels |= 1 << i;
    }
}
