/* The algebraic baseline (physics.md 1, last formula): no filter but a first-order low-pass on every signal alike. */
#include "estimator.h"

/* Variance of a low-passed white signal. */
static tg_real smooth_variance(tg_real noise, tg_real gain)
{
    return noise * noise * gain / (2 - gain);
}

/* Low-pass the signal; its derivative is what the low-pass still lacks, over its time constant. */
static tg_real follow(tg_lowpass *f, tg_real x, double time, tg_real tau, tg_real *rate)
{
    tg_real dt = (tg_real)(time - f->time), old = f->value;
    int32_t seen = f->seen;
    tgi_lowpass(f, x, time, tau);
    if (!isnan(x) && rate) *rate = seen && dt > 0 ? (f->value - old) / dt : 0;
    return f->value;
}

/* Considered constants in closed form (physics.md 6): a wheel acceleration a too large is an adhesion J a/(r F) too large, and rho_s balances
 * the forces. */
static void consider_statically(tg_estimator *e, const tg_drive *drive, const tg_input *now)
{
    const tg_settings *s = &e->settings;
    const tg_machine *m = &s->machine;
    const int32_t n = m->wheels;
    tg_belief *b = &e->belief;
    const tg_deviations *const d = &e->deviations;
    tgi_deviations(e, now, b->x);
    memset(e->consider.s, 0, sizeof e->consider.s);
    for (int32_t c = 0; c < b->columns; c++) {
        tg_real acceleration = d->acceleration[c];
        for (int32_t i = 0; i < n; i++) {
            tg_real torque = m->inertia[i] * d->wheel_acceleration[i][c];
            e->consider.s[i][c] = torque / (m->radius[i] * now->load[i]);
            acceleration += torque / (m->radius[i] * drive->mass);
        }
        e->consider.s[n][c] = acceleration / (m->gravity * drive->cosine + drive->hitch_load * drive->inverse_mass);
    }
}

/* Noise that passes the low-pass, and what it makes of mu and rho_s. */
static void spread(tg_estimator *e, const tg_drive *drive)
{
    const tg_settings *s = &e->settings;
    const tg_machine *m = &s->machine;
    const tg_algebra *a = &e->algebra;
    const int32_t n = m->wheels, stride = tgi_stride(n), rho = n, v = n + 1;
    const tg_real weight = drive->mass * m->gravity + drive->hitch_load, inverse_tau = 1 / s->algebraic_filter;
    tg_belief *b = &e->belief;
    memset(b->P, 0, sizeof b->P);
    tg_real ground = smooth_variance(s->noise[TG_GROUND_SPEED], a->gain);
    tg_real rate = s->noise[TG_GROUND_SPEED] * s->noise[TG_GROUND_SPEED] * inverse_tau * inverse_tau;
    tg_real pull = smooth_variance(s->noise[TG_DRAWBAR_FORCE], a->gain);
    tg_real resistance = (drive->mass * drive->mass * rate + pull) / (weight * weight);
    b->P[v * stride + v] = ground;
    for (int32_t i = 0; i < n; i++) {
        tg_real lever = 1 / (m->radius[i] * drive->load[i]), wheel = s->noise[TG_WHEEL_SPEED + i];
        tg_real torque = e->braked ? e->constants.unknown_torque[i] : s->driven[i] ? smooth_variance(s->noise[TG_DRIVE_TORQUE + i], a->gain) : 0;
        tg_real spin = m->inertia[i] * wheel * inverse_tau;
        tg_real mu = (torque + spin * spin) * lever * lever;
        int32_t omega = n + 2 + i;
        b->P[omega * stride + omega] = smooth_variance(wheel, a->gain);
        b->P[i * stride + i] = mu;
        b->P[rho * stride + i] = mu * drive->load[i] / weight;
        resistance += mu * (drive->load[i] / weight) * (drive->load[i] / weight);
    }
    b->P[rho * stride + rho] = resistance;
}

/* One row of the algebraic method into the belief; `now`: its inputs along the travel. `anew`: nothing continues from before (first sample, gap, standstill, change of direction). */
void tgi_algebraic(tg_estimator *e, const tg_row *row, const tg_drive *drive, const tg_input *now, int32_t anew)
{
    const tg_settings *s = &e->settings;
    const tg_machine *m = &s->machine;
    const int32_t n = m->wheels;
    const tg_real tau = s->algebraic_filter, d = (tg_real)e->direction;
    tg_algebra *a = &e->algebra;
    tg_belief *b = &e->belief;
    if (anew) memset(a, 0, sizeof *a);
    tg_real dt = (tg_real)(row->time - e->time);
    a->gain = anew ? 1 : dt / (tau + dt); /* of the first sample all passes */

    tg_real thrust = 0, rim = 0;
    for (int32_t i = 0; i < n; i++) {
        tg_real omega = d * follow(&a->wheel[i], row->value[TG_WHEEL_SPEED + i], row->time, tau, &a->wheel_rate[i]);
        tg_real torque = d * follow(&a->torque[i], drive->torque[i], row->time, tau, NULL);
        tg_real drag = m->radius[i] * m->bearing_resistance[i] * omega;
        b->x[n + 2 + i] = omega;
        b->x[i] = (torque - m->inertia[i] * d * a->wheel_rate[i] - drag) / (m->radius[i] * drive->load[i])
                        - m->tire_rolling_resistance;
        thrust += b->x[i] * drive->load[i];
        rim += m->radius[i] * omega / (tg_real)n;
    }
    tg_real v = d * follow(&a->ground, row->value[TG_GROUND_SPEED], row->time, tau, &a->ground_rate);
    tg_real pull = d * follow(&a->drawbar, drive->drawbar, row->time, tau, NULL);
    tg_real slope = d * drive->slope;
    b->x[n + 1] = a->ground.seen ? v : rim;
    b->x[n] = (thrust - pull - drive->mass * (d * a->ground_rate + m->gravity * tgi_sin(slope)))
                    / (drive->mass * m->gravity * tgi_cos(slope) + drive->hitch_load);
    spread(e, drive);
    consider_statically(e, drive, now);
}
