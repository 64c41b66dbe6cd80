/* Inputs of the model: held between their samples, and the noise that holding them makes. */
#include "estimator.h"

#define TG_BUMPS ((tg_real)2e-3) /* m^2/s^3: forces of bumps on the speed, which an accelerometer would show */
#define TG_LATE ((tg_real)1.01) /* intervals after which a sample is late; not 1, where rounding would decide */
#define TG_UNKNOWN_SLOPE ((tg_real)0.01) /* rad^2, of a pitch never seen or long silent */

/* The input itself is filtered as a random walk in noise, with a time constant of at most TG_INPUT_LAG: between two wheel speeds a raw
 * torque's noise would shake omega more than the wheel ever does. */
static void track(tg_hold *h, tg_real x, tg_real motion, tg_real noise, tg_real interval)
{
    tg_real prior = h->variance + (motion > 0 ? motion : 0), gain = prior / (prior + noise * noise);
    const tg_real least = interval / (TG_INPUT_LAG + interval);
    if (!(gain > least)) gain = least;
    h->value += gain * (x - h->value);
    h->variance = gain * noise * noise;
}

/* Take a sample of an input (NaN: none). The mean square of its increments is kept over about 1 s; one far beyond it is a spike:
 * taken whole, but its square counts as uncertainty until the next sample, and the mean square sees it clipped. */
void tgi_hold_update(tg_hold *h, tg_real x, double time, tg_real noise)
{
    if (isnan(x)) return;
    h->spike = 0;
    if (h->count == 0) {
        h->value = x;
        h->variance = noise * noise;
    } else {
        tg_real interval = (tg_real)(time - h->time), change = tgi_square(x - h->raw);
        tg_real bound = TG_SPIKE * TG_SPIKE * (h->level + 2 * noise * noise);
        if (h->count > TG_SPIKE && change > bound) {
            h->spike = change;
            h->value = x;
            h->variance = noise * noise;
            change = bound;
        } else {
            track(h, x, h->level - 2 * noise * noise, noise, interval);
        }
        tg_real memory = interval / (1 + interval);
        if (memory * (tg_real)h->count < 1) memory = 1 / (tg_real)h->count; /* a plain mean at first */
        h->level += memory * (change - h->level);
        h->interval = interval;
    }
    if (h->spike == 0) h->calm = h->value;
    h->raw = x;
    h->time = time;
    if (h->count < 100) h->count++;
}

/* Variance of a held input's error: its noise, and what it moves between samples. A straight line from one sample to the next is off
 * by a third of the squared increment in the mean square; held longer, it wanders on (R). */
static tg_real hold_variance(const tg_hold *h, double time, tg_real noise)
{
    tg_real motion = h->level - 2 * noise * noise, variance = h->variance + h->spike;
    if (motion > 0 && h->interval > 0) {
        tg_real age = (tg_real)(time - h->time);
        variance += motion * (age > TG_LATE * h->interval ? age / h->interval : (tg_real)(1.0 / 3));
    }
    return variance;
}

/* Error of one held input as extra variance of its state over the step that ends at `time`. The error stays the same from sample to
 * sample: `age` after one it has moved the state by (age error), so this step adds error^2 (age^2 - (age - dt)^2). Of that only a half
 * counts: what lasts, the estimated adhesion takes along (tuned, see tg_default_settings). `unknown` is the variance before the first
 * sample and once the last one is older than a gap. */
static tg_real held_noise(const tg_estimator *e, const tg_hold *h, double time, tg_real dt, tg_real noise, tg_real unknown)
{
    if (h->count == 0) return dt * unknown;
    tg_real age = (tg_real)(time - h->time);
    tg_real variance = hold_variance(h, time, noise) + (age > e->settings.gap ? unknown : 0);
    return dt * (2 * age - dt) / 2 * variance;
}

/* Input noise of the step that ends at `time`, from the inputs as they were held over it (PHYSICS 1: torque moves omega, drawbar
 * force and slope move v). */
void tgi_input_noise(const tg_estimator *e, double time, tg_real dt, tg_real *q)
{
    const tg_settings *s = &e->settings;
    const tgi_constants *c = &e->constants;
    const int32_t n = s->machine.wheels;
    for (int32_t j = 0; j < TG_MAX_STATES; j++) q[j] = 0;
    for (int32_t i = 0; i < n; i++)
        if (s->driven[i])
            q[i] = held_noise(e, &e->torque[i], time, dt, s->noise[TG_DRIVE_TORQUE + i], c->unknown_torque[i])
                 * tgi_square(c->inverse_inertia[i]);
    if (e->drawbar.count > 0 || s->towing)
        q[n] += held_noise(e, &e->drawbar, time, dt, s->noise[TG_DRAWBAR_FORCE], c->unknown_pull) * tgi_square(c->inverse_mass);
    if (!e->slope.running) q[n] += TG_BUMPS * dt;
    if (e->pitch.count > 0)
        q[n] += held_noise(e, &e->pitch, time, dt, s->noise[TG_PITCH], TG_UNKNOWN_SLOPE) * tgi_square(s->machine.gravity);
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
    drive->calm_drawbar = e->drawbar.calm;
    drive->slope = tgi_slope_update(e, row, e->pitch.value, dt);
    drive->cosine = tgi_cos(drive->slope);
    drive->sine = tgi_sin(drive->slope);
}

void tgi_along(const tg_estimator *e, const tg_drive *drive, tg_input *u)
{
    const tg_real d = (tg_real)e->direction;
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) {
        u->torque[i] = d * drive->torque[i];
        u->load[i] = drive->load[i];
    }
    u->drawbar = d * drive->drawbar;
    u->slope = d * drive->slope;
}
