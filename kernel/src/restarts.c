/* The filter where the motion is interrupted: at rest, at the start from it, after a gap, after it diverged. */
#include "estimator.h"

#define TG_NO_TIME ((tg_real)1e-6) /* s */

/* Considered columns, and a smoother's track, follow the filter's last step. */
void tgi_follow(tg_estimator *e, const tg_deviations *deviations)
{
    tg_consider_step(&e->consider, &e->filter, deviations);
    if (e->track) tg_track_step(e->track, &e->filter);
}

/* A filter that diverged starts again from the priors. */
void tgi_forget(tg_estimator *e)
{
    tgi_filter_anew(&e->filter, &e->settings);
    tg_consider_init(&e->consider, &e->filter, e->belief.columns);
    if (e->track) tg_track_init(e->track, &e->filter);
    e->scene.anew = 1;
}

/* Restart the outputs at `outputs`, with `walk` seconds of the parameters' random walk added. */
static void restart(tg_estimator *e, tg_real walk, const tg_real *outputs, const tg_real *variances)
{
    if (walk > e->settings.tuned.longest_walk) walk = e->settings.tuned.longest_walk;
    if (tg_filter_restart(&e->filter, walk, outputs, variances) != TG_OK) {
        tgi_forget(e);
        tg_filter_restart(&e->filter, 0, outputs, variances);
    }
    tgi_follow(e, NULL);
}

/* Outputs as this row measures them, along the travel. What it does not measure follows from the rest, broadly: a wheel from the
 * ground speed, the ground speed from what it just was, else from the wheels. */
void tgi_restart_from(tg_estimator *e, const tg_row *row, tg_real walk)
{
    const tg_settings *s = &e->settings;
    const int32_t n = s->machine.wheels;
    const tg_real d = (tg_real)e->direction, *y = row->value;
    tg_real x[9], P[9], rim = 0, v = y[TG_GROUND_SPEED];
    int32_t seen = 0;
    for (int32_t i = 0; i < n; i++) {
        if (isnan(y[TG_WHEEL_SPEED + i])) continue;
        rim += s->rolling_radius[i] * y[TG_WHEEL_SPEED + i];
        seen++;
    }
    int32_t late = isnan(v) && tgi_is_recent(e, TG_GROUND_SPEED, row->time);
    if (late) v = e->settling[TG_GROUND_SPEED].settled;
    else if (isnan(v)) v = seen ? rim / (tg_real)seen : 0;
    tg_real broad = tgi_square((tg_real)0.3 * tgi_fabs(v) + (tg_real)0.1), noise = tgi_square(s->noise[TG_GROUND_SPEED]) + row->doubt[TG_GROUND_SPEED];
    x[n] = d * v;
    P[n] = isnan(y[TG_GROUND_SPEED]) ? (late ? noise + (tg_real)0.01 : broad) : noise;
    for (int32_t i = 0; i < n; i++) {
        tg_real omega = y[TG_WHEEL_SPEED + i], r = s->rolling_radius[i];
        x[i] = d * (isnan(omega) ? v / r : omega);
        P[i] = isnan(omega) ? broad / (r * r) : tgi_square(s->noise[TG_WHEEL_SPEED + i]) + row->doubt[i];
    }
    restart(e, walk, x, P);
}

/* Adhesion before a standstill or a change of direction shows little of the start: it is as uncertain as at first. No time passes, but
 * the filter needs a time above 0. */
void tgi_unknown_adhesion(tg_estimator *e)
{
    const int32_t n = e->settings.machine.wheels;
    tg_real q[TG_MAX_STATES] = {0};
    for (int32_t i = 0; i < n; i++) q[n + 1 + i] = tgi_square(e->settings.prior_adhesion_std);
    if (tg_filter_predict(&e->filter, TG_NO_TIME, &e->held, q) == TG_OK) tgi_follow(e, NULL);
    if (e->filter.tuning.policy != TG_BANK) return;
    for (int b = 0; b < TG_MODES; b++) e->filter.policy.bank.probability[b] = (tg_real)1 / TG_MODES;
}

/* The direction of travel turns, and with it the signs of all that counts along it: the belief of the row before is mirrored, so that
 * this row is predicted from it. What opposed the travel drives it now, since forces go on where the motion turns. */
void tgi_turn(tg_estimator *e)
{
    const int32_t n = e->settings.machine.wheels, stride = tgi_stride(n);
    tg_real x[9], P[9], mu[TG_MAX_WHEELS];
    for (int32_t j = 0; j <= n; j++) {
        const int32_t row = tgi_row(n, j);
        x[j] = -e->belief.x[row];
        P[j] = e->belief.P[row * stride + row];
    }
    for (int32_t i = 0; i < n; i++) mu[i] = -e->belief.x[i];
    restart(e, 0, x, P);
    tgi_place_adhesion(&e->filter, mu);
}

/* At standstill the low-passed speeds are the outputs; one that is no longer measured is that of a vehicle that stands. Adhesion is held
 * until the torques surely ask for more: wheels that show no slow turn may start unseen. Before the first motion it follows from them. */
void tgi_rest(tg_estimator *e, const tg_drive *drive, double time)
{
    const tg_settings *s = &e->settings;
    const int32_t n = s->machine.wheels;
    tg_real d = (tg_real)e->direction, x[9], P[9];
    for (int32_t j = 0; j <= n; j++) {
        const int32_t slot = j < n ? TG_WHEEL_SPEED + j : TG_GROUND_SPEED, fresh = tgi_is_recent(e, slot, time);
        x[j] = fresh ? d * e->settling[slot].settled : 0;
        P[j] = tgi_square(fresh ? s->noise[slot] : s->standstill_speed / (j < n ? s->rolling_radius[j] : 1));
    }
    restart(e, 0, x, P);
    if (e->braked) return;
    tg_real mu[TG_MAX_WHEELS];
    e->by_torque |= !(e->distance > 0);
    for (int32_t i = 0; i < n; i++) {
        const tg_real arm = s->machine.radius[i] * drive->load[i], held = e->belief.x[i], by_torque = e->torque[i].count ? d * e->torque[i].value / arm : 0;
        const tg_real beyond = tgi_fabs(by_torque) - tgi_fabs(held) - s->machine.tire_rolling_resistance; /* which opposes any motion */
        const tg_real variance = tgi_square(s->noise[TG_DRIVE_TORQUE + i] / arm) + e->belief.P[i * (tgi_stride(n) + 1)];
        const int32_t possible = tgi_fabs(by_torque) <= 1;
        e->by_torque |= possible && beyond > 0 && tgi_square(beyond) > tgi_square(s->tuned.spike) * variance;
        mu[i] = possible ? by_torque : held;
    }
    if (!e->by_torque) return;
    tgi_place_adhesion(&e->filter, mu);
}

/* Nothing measured for too long: the estimate stays and its spread grows, since old torques must not be integrated. */
void tgi_drift(tg_estimator *e, tg_real dt)
{
    const int32_t n = e->settings.machine.wheels, stride = tgi_stride(n);
    tg_real x[9], P[9], longest = e->settings.tuned.longest_walk, step = dt > longest ? longest : dt;
    for (int32_t j = 0; j <= n; j++) {
        tg_real r = j < n ? e->settings.rolling_radius[j] : 1;
        int32_t row = tgi_row(n, j);
        x[j] = e->belief.x[row];
        P[j] = e->belief.P[row * stride + row] + step / (r * r); /* 1 m/s after 1 s */
    }
    restart(e, dt, x, P);
}
