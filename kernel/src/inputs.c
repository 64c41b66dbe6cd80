/* Inputs of the model: held between their samples, and the noise that holding them makes. */
#include "estimator.h"

/* Error of one held input as extra variance of its state over a step: constant between two samples, so that what it adds to the
 * state over their interval T is (T error)^2, spread evenly over the steps. `unknown` is its variance before its first sample and
 * once it is older than a gap. */
static tg_real held_noise(const tg_estimator *e, const tg_hold *h, double time, tg_real dt, tg_real noise, tg_real unknown)
{
    if (h->count == 0) return dt * unknown;
    tg_real age = (tg_real)(time - h->time), interval = h->interval > age ? h->interval : age;
    tg_real variance = tgi_hold_variance(h, time, noise) + (age > e->settings.gap ? unknown : 0);
    return dt * interval * variance;
}

/* Input noise of the step that ends at `time`, from the inputs as they were held over it (PHYSICS 1: torque moves omega, drawbar
 * force and slope move v). */
void tgi_input_noise(const tg_estimator *e, double time, tg_real dt, tg_real *q)
{
    const tg_settings *s = &e->settings;
    const tg_machine *m = &s->machine;
    const int32_t n = m->wheels;
    for (int32_t j = 0; j < TG_MAX_STATES; j++) q[j] = 0;
    for (int32_t i = 0; i < n; i++) {
        if (!s->driven[i]) continue;
        tg_real unknown = tgi_square((tg_real)0.5 * m->radius[i] * e->before.load[i]);
        q[i] = held_noise(e, &e->torque[i], time, dt, s->noise[TG_DRIVE_TORQUE + i], unknown) / tgi_square(m->inertia[i]);
    }
    if (e->drawbar.count > 0 || s->towing) {
        tg_real unknown = tgi_square((tg_real)0.3 * m->mass * m->gravity);
        q[n] += held_noise(e, &e->drawbar, time, dt, s->noise[TG_DRAWBAR_FORCE], unknown) / tgi_square(m->mass);
    }
    if (e->pitch.count > 0)
        q[n] += held_noise(e, &e->pitch, time, dt, s->noise[TG_PITCH], tgi_square((tg_real)0.1)) * tgi_square(m->gravity);
}

void tgi_take_inputs(tg_estimator *e, tg_row *row, tg_real dt, tg_drive *drive)
{
    const tg_settings *s = &e->settings;
    memset(drive, 0, sizeof *drive);
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        if (!s->driven[i]) continue;
        tg_hold *h = &e->torque[i];
        tgi_hold_update(h, row->value[TG_DRIVE_TORQUE + i], row->time, s->noise[TG_DRIVE_TORQUE + i]);
        drive->torque[i] = h->value;
        row->outlier |= h->spike > 0;
    }
    tgi_hold_update(&e->drawbar, row->value[TG_DRAWBAR_FORCE], row->time, s->noise[TG_DRAWBAR_FORCE]);
    tgi_hold_update(&e->pitch, row->value[TG_PITCH], row->time, s->noise[TG_PITCH]);
    row->outlier |= e->drawbar.spike > 0;
    drive->drawbar = e->drawbar.value;
    drive->slope = tgi_slope_update(e, row, e->pitch.value, dt);
}

tg_input tgi_along(const tg_estimator *e, const tg_drive *drive)
{
    tg_input u;
    tg_real d = (tg_real)e->direction;
    memset(&u, 0, sizeof u);
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) {
        u.torque[i] = d * drive->torque[i];
        u.load[i] = drive->load[i];
    }
    u.drawbar = d * drive->drawbar;
    u.slope = d * drive->slope;
    return u;
}
