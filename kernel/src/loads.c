/* Mass and hitch load of a row, and the vertical loads of axles and wheels (physics.md 3). */
#include "estimator.h"

#define TG_LEAST_MASS ((tg_real)0.2)  /* of the machine's: bounds of mass and hitch load; beyond them is a defect of the log */
#define TG_MOST_MASS 10
#define TG_LEAST_HITCH ((tg_real)-0.5) /* of the weight */
#define TG_MOST_HITCH 2
#define TG_STEEPEST ((tg_real)0.25) /* square of the roll's sine: 30 degrees */

/* Update mass or hitch load with a sample, within limits. */
static void bounded_input(tg_estimator *e, tg_hold *h, tg_row *row, int32_t slot, tg_real least, tg_real most)
{
    tg_real *const x = &row->value[slot];
    const int32_t defect = *x < least || *x > most;
    if (defect) *x = (tg_real)NAN;
    tgi_hold_update(e, h, row, slot, 0);
    row->outlier |= defect || (h->spike > 0 && h->time == row->time);
}

/* Mass and hitch load of the row: as last measured, else as the machine's file has them. */
void tgi_weigh(tg_estimator *e, tg_row *row, tg_drive *drive)
{
    const tg_settings *s = &e->settings;
    const tg_real mass = s->machine.mass, weight = mass * s->machine.gravity;
    drive->mass = mass;
    drive->inverse_mass = e->filter.inverse_mass;
    if (s->weighed) bounded_input(e, &e->mass, row, TG_MASS, TG_LEAST_MASS * mass, TG_MOST_MASS * mass);
    if (s->carrying) bounded_input(e, &e->hitch_load, row, TG_HITCH_LOAD, TG_LEAST_HITCH * weight, TG_MOST_HITCH * weight);
    if (e->mass.count > 0) {
        drive->mass = e->mass.value;
        drive->inverse_mass = 1 / e->mass.value;
    }
    if (e->hitch_load.count > 0) drive->hitch_load = e->hitch_load.value;
}

/* Variance of such a value: its noise, and what it may have done from its last sample to the row before. */
static tg_real held_variance(const tg_hold *h, double time, tg_real noise)
{
    return h->variance + h->spike + tgi_walk(h, noise) * (time > h->time ? (tg_real)(time - h->time) : 0);
}

/* Relative SD of the mass; before its first sample a payload is as unknown as a pull. */
tg_real tgi_mass_spread(const tg_estimator *e)
{
    const tg_settings *s = &e->settings;
    tg_real variance = tgi_square(s->uncertainty.mass);
    if (s->weighed && e->mass.count == 0) variance += tgi_square(s->tuned.unknown_pull);
    if (e->mass.count > 0) variance += held_variance(&e->mass, e->time, s->noise[TG_MASS]) / tgi_square(e->mass.value);
    return tgi_sqrt(variance);
}

/* SD of the vertical hitch load, N. */
tg_real tgi_hitch_spread(const tg_estimator *e)
{
    const tg_settings *s = &e->settings;
    const tg_hold *const h = &e->hitch_load;
    tg_real variance = tgi_square(s->uncertainty.hitch_load_gain * h->value) + tgi_square(s->uncertainty.hitch_load_offset);
    const int32_t silent = h->count == 0 || e->time - h->time > (double)s->gap;
    if (silent) variance += e->constants.unknown_pull;
    return tgi_sqrt(h->count > 0 ? variance + held_variance(h, e->time, s->noise[TG_HITCH_LOAD]) : variance);
}

/* Specific force along the vehicle, dv/dt + g sin(slope): the accelerometer's where it is alive, else the balance of the estimated
 * forces; low-passed, for the loads do not follow a shock. */
static tg_real specific_force(tg_estimator *e, const tg_row *row)
{
    const tg_settings *s = &e->settings;
    tgi_lowpass(&e->acceleration, row->value[TG_ACCELERATION_X], row->time, s->load_filter);
    if (e->acceleration.seen && row->time - e->acceleration.time <= 1) return e->acceleration.value;
    return e->balance.seen ? e->balance.value : 0;
}

/* Whether a roll was measured, no longer than a gap ago. */
int32_t tgi_roll_known(const tg_estimator *e, double time) { return e->roll.seen && time - e->roll.time <= (double)e->settings.gap; }

/* Specific force to the left, which moves load from the left wheels to the right: the accelerometer's, else what the turn and a measured
 * roll make of it, v psi' + g sin(roll). And the cosine of the roll: across a slope the ground carries less than the weight. */
static tg_real lateral_force(tg_estimator *e, const tg_row *row, tg_real g, tg_real *upright)
{
    const tg_real turn = (tg_real)e->direction * e->belief.x[e->settings.machine.wheels + 1] * e->yaw_rate;
    const int32_t leans = e->lateral.seen && row->time - e->yaw_time <= 1; /* and does not turn unseen */
    const tg_real felt = tgi_lowpass(&e->lateral, row->value[TG_ACCELERATION_Y], row->time, e->settings.load_filter);
    const tg_real roll = tgi_lowpass(&e->roll, row->value[TG_ROLL], row->time, e->settings.load_filter);
    const tg_real sine = tgi_roll_known(e, row->time) ? tgi_sin(roll) : leans ? (felt - turn) / g : 0, square = tgi_square(sine);
    *upright = tgi_sqrt(1 - (square < TG_STEEPEST ? square : TG_STEEPEST));
    return e->lateral.seen ? felt : turn + g * sine;
}

/* A load measured on an axle is used; axles without one share the rest of the weight by their static shares. */
static void use_measured(tg_estimator *e, const tg_row *row, tg_real weight, tg_real *load)
{
    const tg_settings *s = &e->settings;
    int32_t measured[8], any = 0;
    tg_real rest = weight, computed = 0, share = 0;
    for (int32_t k = 0; k < s->axles; k++) {
        tg_hold *h = &e->axle_load[k];
        tgi_hold_update(e, h, row, TG_VERTICAL_LOAD + k, 0);
        measured[k] = h->count > 0 && row->time - h->time <= 1;
        any |= measured[k];
        if (measured[k]) {
            load[k] = h->value;
            rest -= h->value;
        } else {
            computed += load[k];
            share += s->load_share[k];
        }
    }
    if (!any) return;
    for (int32_t k = 0; k < s->axles; k++)
        if (!measured[k]) load[k] += (rest - computed) * s->load_share[k] / share;
}

/* What opposes a wheel's own turning, and so is no part of the model: the friction of its drive, taken off the torque; and the tyre's
 * resistance, which the model takes to oppose the travel: of a wheel that turns against that, as on the inner side of a turn on the spot,
 * twice the resistance is added. */
static void oppose_turning(const tg_estimator *e, tg_drive *drive)
{
    const tg_settings *s = &e->settings;
    const tg_real d = (tg_real)e->direction;
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        const tg_real turning = s->rolling_radius[i] * e->settling[i].soon / s->standstill_speed;
        if (d * turning >= 0 && !(s->drive_friction[i] > 0)) continue;
        const tg_real way = turning < -1 ? -1 : turning > 1 ? 1 : turning;
        tg_real less = s->drive_friction[i] * way;
        if (d * way < 0) less += 2 * way * s->machine.radius[i] * s->machine.tire_rolling_resistance * drive->load[i];
        drive->torque[i] -= less;
    }
}

/* F_k = share_k m g cos cos(roll) + transfer_k moment, the moment that lifts the front being m h (dv/dt + g sin) + F_dx h_d + sum J dw/dt; added
 * to it a payload beyond the file's mass, with its own shares and height, and the load on the hitch. A wheel keeps at
 * least 2 % of its static load: the model divides by it. */
void tgi_loads(tg_estimator *e, const tg_row *row, tg_drive *drive)
{
    const tg_settings *s = &e->settings;
    const tg_machine *m = &s->machine;
    tg_real a = specific_force(e, row), g = m->gravity;
    tg_real upright, lateral = lateral_force(e, row, g, &upright);
    tg_real weight = m->mass * g * drive->cosine * upright, payload = drive->mass - m->mass;
    tg_real moment = m->mass * s->center_of_gravity_height * a + drive->calm_drawbar * s->hitch_height
                   + e->constants.spin_inertia * (a - g * drive->sine);
    tg_real load[8], lean = 1;
    if (e->mass.count > 0) {
        const tg_real height = m->mass * s->center_of_gravity_height + payload * s->payload_height;
        moment += payload * s->payload_height * a;
        if (s->center_of_gravity_height > 0) lean = height / (drive->mass * s->center_of_gravity_height);
    }
    for (int32_t k = 0; k < s->axles; k++) load[k] = s->load_share[k] * weight - s->load_transfer[k] * moment;
    if (e->mass.count > 0 || e->hitch_load.count > 0) {
        const tg_real more = payload * g * drive->cosine * upright;
        for (int32_t k = 0; k < s->axles; k++) load[k] += s->payload_share[k] * more + s->hitch_share[k] * drive->hitch_load;
        weight += more + drive->hitch_load;
    }
    use_measured(e, row, weight, load);

    lateral *= lean;
    for (int32_t k = 0; k < s->axles; k++) drive->axle_load[k] = load[k];
    for (int32_t i = 0; i < m->wheels; i++) {
        tg_real least = e->constants.least_load[i], wheel = load[s->wheel_axle[i]] * (s->wheel_share[i] - s->lateral_share[i] * lateral);
        drive->load[i] = wheel > least ? wheel : least;
    }
    oppose_turning(e, drive);
}
