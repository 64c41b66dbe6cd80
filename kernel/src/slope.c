/* Slope as the motion shows it, where there is an accelerometer: it reads dv/dt + g sin(slope), so what it reads beyond the change of
 * ground speed is slope. A pitch sensor alone errs by its mounting and by wheels that sink unevenly; without one the whole slope is
 * found, and where ground speeds disagree with the forces a sensed one may be as wrong: a pose in a map that is not level errs by the course
 * (docs/decisions/0174-while-the-ground-speed-is-silent.md). A Kalman filter of two states, ground speed and slope error, beside the main one
 * (R). The effect of a whole slope's error on the speed over a step is process noise of the main filter, which then weights ground speeds as
 * this one does. The accelerometer's bias is part of the slope error too, as it should be: the two then agree on dv/dt. */
#include "estimator.h"

#define TG_SLOPE_LIMIT ((tg_real)0.5) /* rad: no vehicle of ours drives steeper */

static void start(tgi_slope *s, const tg_settings *settings, tg_real speed)
{
    s->speed = speed;
    s->speed_variance = tgi_square(settings->noise[TG_GROUND_SPEED]);
    s->covariance = 0;
    s->running = 1;
}

/* Returns the variance that the slope error gives the speed. */
static tg_real predict(tgi_slope *s, const tg_settings *settings, tg_real pitch, tg_real walk, tg_real force, tg_real dt)
{
    const tg_real g = settings->machine.gravity, k = g * dt;
    const tg_real noise = tgi_square(settings->noise[TG_ACCELERATION_X]) * dt + force; /* of shocks that its noise does not hold */
    s->speed += dt * (s->acceleration - g * (tgi_sin(pitch) + s->error));
    const tg_real drift_by_slope = k * (k * s->error_variance - 2 * s->covariance);
    s->speed_variance += drift_by_slope + noise * dt;
    s->covariance -= k * s->error_variance;
    s->error_variance += walk * dt;
    return drift_by_slope;
}

/* Take a ground speed of this variance. */
void tgi_slope_correct(tgi_slope *s, tg_real speed, tg_real noise)
{
    tg_real innovation = speed - s->speed;
    tg_real variance = s->speed_variance + noise, size = tgi_square(innovation) / variance;
    if (size > 9) variance += noise * (tgi_sqrt(size) / 3 - 1); /* a spike: weighted as in the main filter */
    tg_real gain = s->speed_variance / variance, error_gain = s->covariance / variance;
    s->speed += gain * innovation;
    s->error += error_gain * innovation;
    s->error_variance -= error_gain * s->covariance;
    s->covariance *= 1 - gain;
    s->speed_variance *= 1 - gain;
    if (s->error > TG_SLOPE_LIMIT) s->error = TG_SLOPE_LIMIT;
    if (s->error < -TG_SLOPE_LIMIT) s->error = -TG_SLOPE_LIMIT;
}

/* Take a row; `pitch` as measured, 0 where it is not. */
void tgi_slope_update(tg_estimator *e, const tg_row *row, tg_real pitch, tg_real dt, tg_drive *drive)
{
    tgi_slope *s = &e->slope;
    const tg_settings *settings = &e->settings;
    const tg_real speed = row->value[TG_GROUND_SPEED];
    const int32_t sensed = e->pitch.count > 0;
    const tg_real unknown = sensed ? tgi_alike_share(e) : 1; /* a mounting is a constant, and considered */
    const tg_real walk = (sensed ? e->constants.mounting_walk : 0) + unknown * settings->tuned.terrain_walk * tgi_fabs(s->speed) / e->constants.mean_radius;
    if (s->running && (dt > settings->gap || row->time - e->acceleration.time > 1)) s->running = 0;
    const tg_real drift_by_slope = s->running && dt > 0 ? predict(s, settings, pitch, walk, e->constants.force_walk, dt) : 0;
    drive->drift_by_slope = unknown * drift_by_slope;
    if (!isnan(row->value[TG_ACCELERATION_X])) s->acceleration = row->value[TG_ACCELERATION_X];
    if (!isnan(speed)) {
        const tg_real noise = e->constants.variance[TG_GROUND_SPEED] + row->turn_variance + row->doubt[TG_GROUND_SPEED];
        if (s->running) {
            const tg_real innovation = speed - s->speed, variance = s->speed_variance + noise;
            tgi_watch_draw(e, innovation, variance, s->speed_variance / variance);
            tgi_slope_correct(s, speed, noise);
        }
        else if (e->acceleration.seen) start(s, settings, speed);
    }
    drive->slope = pitch + s->error;
}
