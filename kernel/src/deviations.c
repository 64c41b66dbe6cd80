/* Considered constants of the machine and its sensors: what one SD of each adds to the computed motion (physics.md 6). */
#include "estimator.h"

/* A pull at the hitch that nothing measures reads as soil resistance, and the load that it moves between the axles is not known. */
static int32_t pull_is_unseen(const tg_settings *s) { return !s->towing && s->hitch_height > 0 && s->axles > 1; }

/* Column k: wheel i carries `gain[i]` more. Returns the force that this adds to the vehicle. */
static tg_real add_loads(const tg_estimator *e, const tg_real *mu, const tg_real *gain, tg_deviations *d, int32_t k)
{
    const tg_machine *m = &e->settings.machine;
    tg_real force = 0;
    for (int32_t i = 0; i < m->wheels; i++) {
        d->wheel_acceleration[i][k] = -m->radius[i] * (mu[i] + m->tire_rolling_resistance) * gain[i] * e->filter.inverse_inertia[i];
        force += mu[i] * gain[i];
    }
    return force;
}

/* What the front axles gain and the rear axles lose: a share of the mean axle load, and what an unseen pull may move, which is at most
 * all of rho_s. */
static void shift_loads(const tg_estimator *e, tg_real weight, tg_real inverse_mass, const tg_real *mu, tg_deviations *d, int32_t k)
{
    const tg_settings *s = &e->settings;
    tg_real largest = 0, gain[TG_MAX_WHEELS];
    for (int32_t a = 0; a < s->axles; a++) largest = tgi_max(largest, tgi_fabs(s->load_transfer[a]));
    if (!(largest > 0)) return;
    const tg_real share = s->uncertainty.vertical_load * weight / ((tg_real)s->axles * largest);
    const tg_real pull = pull_is_unseen(s) ? mu[s->machine.wheels] * weight * s->hitch_height : 0;
    const tg_real moment = tgi_sqrt(share * share + pull * pull);
    for (int32_t i = 0; i < s->machine.wheels; i++) gain[i] = moment * s->load_transfer[s->wheel_axle[i]] * s->wheel_share[i];
    d->acceleration[k] = d->accelerometer[k] = add_loads(e, mu, gain, d, k) * inverse_mass;
}

/* Of the vertical hitch load, wheel i's part. */
static tg_real hitch_part(const tg_settings *s, int32_t i) { return s->hitch_share[s->wheel_axle[i]] * s->wheel_share[i]; }

/* More mass, where the payload is: the loads grow with it, but for what the hitch does to them, and the forces move the vehicle less. */
static void add_mass(const tg_estimator *e, const tg_input *u, tg_real inverse_mass, const tg_real *mu, tg_deviations *d, int32_t k)
{
    const tg_settings *s = &e->settings;
    const int32_t n = s->machine.wheels;
    const tg_real share = tgi_mass_spread(e), empty = s->machine.mass * s->machine.gravity;
    const tg_real pull = (tg_real)e->direction * u->drawbar * s->hitch_height; /* the moment that lifts the front */
    tg_real gain[TG_MAX_WHEELS], balance = -u->drawbar - mu[n] * u->hitch_load;
    for (int32_t i = 0; i < n; i++) {
        const tg_real hitch = hitch_part(s, i) * u->hitch_load - s->load_transfer[s->wheel_axle[i]] * s->wheel_share[i] * pull;
        const int32_t axle = s->wheel_axle[i];
        gain[i] = share * (u->load[i] - hitch + (s->payload_share[axle] - s->load_share[axle]) * s->wheel_share[i] * empty);
        balance += mu[i] * u->load[i];
    }
    d->acceleration[k] = d->accelerometer[k] = (add_loads(e, mu, gain, d, k) - share * balance) * inverse_mass;
}

static void add_hitch_load(const tg_estimator *e, tg_real inverse_mass, const tg_real *mu, tg_deviations *d, int32_t k)
{
    const tg_settings *s = &e->settings;
    const int32_t n = s->machine.wheels;
    const tg_real spread = tgi_hitch_spread(e);
    tg_real gain[TG_MAX_WHEELS];
    for (int32_t i = 0; i < n; i++) gain[i] = spread * hitch_part(s, i);
    d->acceleration[k] = d->accelerometer[k] = (add_loads(e, mu, gain, d, k) - mu[n] * spread) * inverse_mass;
}

/* The slope is known better where the motion shows it; the remaining error of a whole slope is noise, see slope.c. */
static tg_real slope_spread(const tg_estimator *e)
{
    const tg_real given = e->settings.uncertainty.slope, found = tgi_sqrt(e->slope.error_variance);
    if (!e->slope.running) return given;
    return e->pitch.count == 0 ? 0 : found < given ? found : given;
}

/* More slope, by which cos(slope) moves by its square only. Where no accelerometer reads it, it also moves load off the front, unseen. */
static void add_slope(const tg_estimator *e, tg_real mass, tg_real inverse_mass, const tg_real *mu, tg_deviations *d, int32_t k)
{
    const tg_settings *s = &e->settings;
    const tg_real force = s->machine.gravity * slope_spread(e);
    const tg_real moment = e->acceleration.seen ? 0 : (tg_real)e->direction * mass * s->center_of_gravity_height * force;
    tg_real gain[TG_MAX_WHEELS];
    for (int32_t i = 0; i < s->machine.wheels; i++) gain[i] = -moment * s->load_transfer[s->wheel_axle[i]] * s->wheel_share[i];
    d->acceleration[k] = add_loads(e, mu, gain, d, k) * inverse_mass - force;
}

/* Work out e->deviations, a column for each constant that has a spread; returns how many, which the settings alone decide. `u` are the inputs
 * along the travel, `mu` adhesion and rho_s. What a constant does not touch stays 0 from the start. */
int32_t tgi_deviations(tg_estimator *e, const tg_input *u, const tg_real *mu)
{
    const tg_settings *s = &e->settings;
    const tg_uncertainty *spread = &s->uncertainty;
    const tg_real *inverse_inertia = e->filter.inverse_inertia;
    const int32_t n = s->machine.wheels;
    const tg_real mass = u->mass > 0 ? u->mass : s->machine.mass, inverse_mass = u->mass > 0 ? 1 / u->mass : e->filter.inverse_mass;
    tg_deviations *d = &e->deviations;
    int32_t k = 0;
    if (spread->drive_torque_gain > 0 || spread->drive_torque_offset > 0)
        for (int32_t i = 0; i < n; i++) {
            if (!s->driven[i]) continue;
            tg_real variance = tgi_square(spread->drive_torque_gain * u->torque[i]) + tgi_square(spread->drive_torque_offset);
            d->wheel_acceleration[i][k++] = tgi_sqrt(variance) * inverse_inertia[i];
        }
    if (spread->drive_torque_gain_common > 0) {
        for (int32_t i = 0; i < n; i++)
            d->wheel_acceleration[i][k] = spread->drive_torque_gain_common * u->torque[i] * inverse_inertia[i];
        k++;
    }
    if (spread->drawbar_gain > 0 || spread->drawbar_offset > 0) {
        const tg_real variance = tgi_square(spread->drawbar_gain * u->drawbar) + tgi_square(spread->drawbar_offset);
        d->acceleration[k] = d->accelerometer[k] = -tgi_sqrt(variance) * inverse_mass;
        k++;
    }
    if (spread->slope > 0) add_slope(e, mass, inverse_mass, mu, d, k++);
    if (spread->tire_rolling_resistance > 0) {
        for (int32_t i = 0; i < n; i++)
            d->wheel_acceleration[i][k] = -s->machine.radius[i] * spread->tire_rolling_resistance * u->load[i] * inverse_inertia[i];
        k++;
    }
    if (spread->vertical_load > 0 || pull_is_unseen(s)) shift_loads(e, mass * s->machine.gravity, inverse_mass, mu, d, k++);
    if (spread->mass > 0 || s->weighed) add_mass(e, u, inverse_mass, mu, d, k++);
    if (s->carrying) add_hitch_load(e, inverse_mass, mu, d, k++);
    if (spread->acceleration_bias > 0) {
        d->accelerometer[k] = -spread->acceleration_bias;
        d->acceleration[k++] = e->slope.running ? -spread->acceleration_bias : 0; /* it is in the slope, see slope.c */
    }
    return k;
}
