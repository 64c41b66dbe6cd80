/* Inputs of the model: held between their samples, and the noise that holding them makes. */
#include "estimator.h"

#define TG_LEAST_SAMPLES 4 /* before any can be called a spike */


/* The input itself is filtered as a random walk in noise, with a time constant of at most `lag`: between two wheel speeds a raw
 * torque's noise would shake omega more than the wheel ever does. */
static void track(tg_hold *h, tg_real x, tg_real motion, tg_real noise, tg_real interval, tg_real lag)
{
    tg_real prior = h->variance + (motion > 0 ? motion : 0), gain = prior / (prior + noise * noise);
    const tg_real least = interval / (lag + interval);
    if (!(gain > least)) gain = least;
    h->value += gain * (x - h->value);
    h->variance = gain * noise * noise;
}

/* The value that a sample after a spike goes on from: the spike's own where the sample confirms it, else the last one that was none. */
static tg_real before_spike(const tg_hold *h, tg_real x)
{
    return h->spike > 0 && tgi_fabs(x - h->raw) < tgi_fabs(x - h->calm) ? h->raw : h->calm;
}

/* Take a sample of an input (NaN: none) at `time`, the row before it being dt old. The mean square of its increments is kept over about
 * 1 s; one far beyond it is a spike: until the next sample tells, the value before it stands and its square counts as uncertainty, and the
 * mean square sees it clipped. `rate`: what the signal may change a second without being one. */
void tgi_hold_update(tg_hold *h, const tg_tuned *k, tg_real x, double time, tg_real dt, tg_real noise, tg_real rate)
{
    h->fresh = 0;
    h->mean = h->calm;
    if (isnan(x)) return;
    if (h->count == 0) {
        h->value = h->calm = h->mean = x;
        h->variance = noise * noise;
    } else {
        const tg_real interval = (tg_real)(time - h->time), before = before_spike(h, x);
        tg_real change = tgi_square(x - before), bound = k->spike * k->spike * (h->level + 2 * noise * noise) + tgi_square(rate * interval);
        h->spike = 0;
        if (h->count > TG_LEAST_SAMPLES && change > bound) {
            h->spike = change;
            h->mean = h->calm = before;
            change = bound;
        } else {
            track(h, x, h->level - 2 * noise * noise, noise, interval, k->input_lag);
            h->calm = x;
            h->mean = x - (x - before) * (dt < interval ? dt / interval : 1) / 2; /* of a straight line since the last sample */
            h->fresh = 1;
        }
        tg_real memory = interval / (k->increment_memory + interval);
        if (memory * (tg_real)h->count < 1) memory = 1 / (tg_real)h->count; /* a plain mean at first */
        h->level += memory * (change - h->level);
        h->interval = interval;
    }
    h->raw = x;
    h->time = time;
    if (h->count < 100) h->count++;
}

/* Error of one input as extra variance of its state over the step that ends at `time`. Where the step ends with a sample, the mean over
 * it is known but for the noise of two samples and what the input does beside the straight line: a random walk of this motion, the twelfth of
 * it (Brownian bridge). Where it does not, the last value stands: its error stays the same, so that `age` after it it has moved the state
 * by (age error), and this step adds error^2 (age^2 - (age - dt)^2); and the input wanders on as a random walk w, of whose integral the
 * variance is w age^3/3. `unknown` is the variance before the first sample and once the last one is older than a gap. */
static tg_real held_noise(const tg_estimator *e, const tg_hold *h, double time, tg_real dt, tg_real noise, tg_real unknown)
{
    if (h->count == 0) return dt * unknown;
    const tg_real motion = h->level - 2 * noise * noise, walk = motion > 0 && h->interval > 0 ? motion / h->interval : 0;
    if (h->fresh) return dt * dt * (noise * noise / 2 + walk * dt / 12);
    const tg_real age = h->spike > 0 && time == h->time ? dt : (tg_real)(time - h->time), since = age - dt;
    const tg_real constant = noise * noise + h->spike + (age > e->settings.gap ? unknown : 0);
    return dt * (2 * age - dt) * constant + walk * (age * age * age - since * since * since) / 3;
}

/* Input noise of the step that ends at `time`, from the inputs as they stood over it (PHYSICS 1: torque moves omega, drawbar
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
    if (e->pitch.count > 0)
        q[n] += held_noise(e, &e->pitch, time, dt, s->noise[TG_PITCH], tgi_square(s->tuned.unknown_slope)) * tgi_square(s->machine.gravity);
}

void tgi_take_inputs(tg_estimator *e, tg_row *row, tg_real dt, tg_drive *drive)
{
    const tg_settings *s = &e->settings;
    memset(drive, 0, sizeof *drive);
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        if (!s->driven[i]) continue;
        tg_hold *h = &e->torque[i];
        tgi_hold_update(h, &s->tuned, row->value[TG_DRIVE_TORQUE + i], row->time, dt, s->noise[TG_DRIVE_TORQUE + i], 0);
        drive->torque[i] = h->calm;
        drive->mean_torque[i] = h->mean;
        row->outlier |= h->spike > 0;
    }
    tgi_hold_update(&e->drawbar, &s->tuned, row->value[TG_DRAWBAR_FORCE], row->time, dt, s->noise[TG_DRAWBAR_FORCE], 0);
    tgi_hold_update(&e->pitch, &s->tuned, row->value[TG_PITCH], row->time, dt, s->noise[TG_PITCH], 0);
    row->outlier |= e->drawbar.spike > 0;
    drive->drawbar = e->drawbar.calm;
    drive->mean_drawbar = e->drawbar.mean;
    drive->calm_drawbar = e->drawbar.value;
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
