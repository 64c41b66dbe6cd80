/* Settings of the estimator: defaults, checks, and an estimator made from them. */
#include "estimator.h"

/* Of the warning: set on simulated drives and simulated snow runs, see docs/decisions/0100. */
static tg_watch_settings default_watch(void)
{
    tg_watch_settings w;
    w.pace = 4;
    w.memory = (tg_real)0.35;
    w.usual = 96;
    w.soon = 6;
    w.ahead = (tg_real)0.18;
    w.beyond = 2;
    w.warn = (tg_real)3.8;
    w.most = 3;
    w.change = (tg_real)0.04;
    w.command = (tg_real)0.03;
    w.high_slip = (tg_real)0.28;
    w.resistance = (tg_real)0.006;
    w.stuck_duration = (tg_real)0.5;
    w.stuck_travel = (tg_real)0.1;
    w.free_travel = (tg_real)0.4;
    w.push = (tg_real)0.005;
    w.thrust = (tg_real)0.05;
    w.push_duration = (tg_real)0.1;
    return w;
}

static tg_tuned default_tuned(void)
{
    tg_tuned k;
    k.adhesion_walk = (tg_real)3e-4;
    k.resistance_walk = (tg_real)4e-5;
    k.force_walk = (tg_real)1e-5;
    k.spike = 4;
    k.agility = (tg_real)0.5;
    k.increment_memory = 1;
    k.input_lag = (tg_real)0.07;
    k.unknown_slope = (tg_real)0.1;
    k.mounting_walk = (tg_real)7e-8;
    k.terrain_walk = (tg_real)8e-5;
    k.silence = (tg_real)0.5;
    k.slip_memory = (tg_real)0.3;
    k.most_slope = (tg_real)0.4;
    k.slip_apart = (tg_real)0.15;
    k.alike = (tg_real)0.1;
    k.carried_alike = (tg_real)0.1;
    k.reckoned_force = 120;
    k.carried_force = 12;
    k.shock_memory = 5;
    k.shock_samples = 2;
    k.longest_walk = 30;
    k.standstill = (tg_real)0.01;
    k.settle = (tg_real)0.2;
    k.leap = (tg_real)0.5;
    k.unknown_torque = (tg_real)0.5;
    k.unknown_pull = (tg_real)0.3;
    k.least_load = (tg_real)0.02;
    k.first_slip = (tg_real)0.08;
    k.slow_share = (tg_real)0.2;
    k.slow_stops = 1;
    k.alike_memory = 1000;
    k.alike_sure = 2;
    k.uneven_length = 4;
    k.uneven_memory = 40;
    k.uneven_most = 4;
    k.slip_length = (tg_real)0.25;
    k.bend = (tg_real)0.5;
    k.bend_spread = (tg_real)0.9;
    k.least_slip = (tg_real)0.02;
    k.small_slip = (tg_real)0.002;
    k.lasting_share = (tg_real)0.5;
    k.soil_spread = (tg_real)0.2;
    k.hill_memory = 1000;
    k.manoeuvre[0] = (tg_real)1e-3;
    k.manoeuvre[1] = (tg_real)3e-2;
    k.manoeuvre[2] = 1;
    k.slipping[0] = (tg_real)2.5e-5;
    k.slipping[1] = (tg_real)2.5e-3;
    k.slipping[2] = (tg_real)0.25;
    k.lasting = 3;
    k.mode_dwell = 2;
    k.first_rate = 1;
    k.slowest = (tg_real)0.1;
    k.apart = (tg_real)0.1;
    return k;
}

/* What is tuned here, on which machines, and what halving and doubling does: docs/decisions/0098, docs/families.md. */
tg_settings tg_default_settings(void)
{
    tg_settings s;
    memset(&s, 0, sizeof s);
    s.tuning = tg_default_tuning();
    s.tuning.huber = 4;
    s.axles = 1;
    s.load_share[0] = 1;
    for (int32_t k = 0; k < TG_SLOTS; k++) s.gain[k] = 1;
    s.prior_adhesion = (tg_real)0.2;
    s.prior_adhesion_std = (tg_real)0.3;
    s.prior_resistance = (tg_real)0.05;
    s.prior_resistance_std = (tg_real)0.05;
    s.slope_spread = (tg_real)0.02;
    s.gap = 2;
    s.max_step = (tg_real)0.02;
    s.outlier_weight = (tg_real)0.5;
    s.load_filter = (tg_real)0.2;
    s.algebraic_filter = (tg_real)0.25;
    s.watch = default_watch();
    s.tuned = default_tuned();
    return s;
}

/* T of the machine (see tg_tuned), and the variance that forces which nothing measures give a speed, per second. */
static tg_real natural_time(const tg_machine *m)
{
    tg_real radius = 0;
    for (int32_t i = 0; i < m->wheels; i++) radius += m->radius[i] / (tg_real)m->wheels;
    return tgi_sqrt(radius / m->gravity);
}

static tg_real force_walk(const tg_settings *s)
{
    const tg_real T = natural_time(&s->machine), g = s->machine.gravity; /* V^2/T = g^2 T */
    return s->tuned.force_walk * g * g * T;
}

static tg_real standstill_speed(const tg_settings *s)
{
    return s->tuned.standstill * s->machine.gravity * natural_time(&s->machine); /* V = g T */
}

/* Densities, variance per second. A rim and the ground speed wander alike, in m/s. */
tg_status tg_tune_walks(tg_settings *s)
{
    if (!s || s->machine.wheels < 1 || s->machine.wheels > TG_MAX_WHEELS) return TG_BAD_ARGUMENT;
    const int32_t n = s->machine.wheels;
    if (!tgi_positive(s->machine.gravity)) return TG_NOT_POSITIVE;
    for (int32_t i = 0; i < n; i++)
        if (!tgi_positive(s->machine.radius[i])) return TG_NOT_POSITIVE;
    const tg_real T = natural_time(&s->machine), force = force_walk(s);
    for (int32_t i = 0; i < n; i++) {
        s->tuning.walk[i] = force / tgi_square(s->machine.radius[i]);
        s->tuning.walk[n + 1 + i] = s->tuned.adhesion_walk / T;
    }
    s->tuning.walk[n] = force;
    s->tuning.walk[2 * n + 1] = s->tuned.resistance_walk / T;
    return TG_OK;
}

static tg_status check_wheels(const tg_settings *s)
{
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        if (s->wheel_axle[i] < 0 || s->wheel_axle[i] >= s->axles) return TG_BAD_ARGUMENT;
        if (!tgi_positive(s->rolling_radius[i]) || !tgi_positive(s->wheel_share[i])) return TG_NOT_POSITIVE;
        if (!tgi_finite(s->lateral_share[i]) || !tgi_finite(s->wheel_side[i]) || !tgi_finite(s->wheel_ahead[i])) return TG_NOT_FINITE;
        if (!tgi_positive(s->noise[TG_WHEEL_SPEED + i])) return TG_NOT_POSITIVE;
    }
    for (int32_t k = 0; k < s->axles; k++) {
        if (!tgi_positive(s->load_share[k])) return TG_NOT_POSITIVE;
        if (!tgi_finite(s->load_transfer[k]) || !tgi_finite(s->payload_share[k]) || !tgi_finite(s->hitch_share[k])) return TG_NOT_FINITE;
    }
    return TG_OK;
}

/* Whether all numbers of an array, or of a structure that is nothing but reals, are finite and positive, or at least not negative. */
static int are_sound(const void *numbers, size_t size, int positive)
{
    const tg_real *const x = numbers;
    for (size_t k = 0; k < size / sizeof *x; k++)
        if (positive ? !tgi_positive(x[k]) : !tgi_not_negative(x[k])) return 0;
    return 1;
}

static tg_status check_numbers(const tg_settings *s)
{
    const tg_watch_settings *const w = &s->watch;
    const tg_real spreads[] = {s->ground_speed_delay, s->payload_height, s->slope_spread, s->standstill_speed, s->dead_band, s->outlier_weight,
                               s->load_filter, s->center_of_gravity_height, s->hitch_height, w->ahead, w->beyond, w->most, w->high_slip,
                               w->stuck_duration, w->stuck_travel, w->free_travel, w->push, w->thrust, w->push_duration};
    const tg_real positive[] = {w->pace, w->memory, w->usual, w->soon, w->change, w->command, w->resistance, s->prior_adhesion_std,
                                s->prior_resistance_std, s->gap, s->max_step, s->algebraic_filter, s->noise[TG_GROUND_SPEED],
                                s->noise[TG_ACCELERATION_X]};
    if (!are_sound(&s->tuned, sizeof s->tuned, 1) || !are_sound(&s->uncertainty, sizeof s->uncertainty, 0)) return TG_NOT_POSITIVE;
    if (!are_sound(spreads, sizeof spreads, 0) || !are_sound(positive, sizeof positive, 1)) return TG_NOT_POSITIVE;
    if (!tgi_finite(s->receiver_ahead) || !tgi_finite(s->receiver_side)) return TG_NOT_FINITE;
    if (!tgi_finite(w->warn) || !tgi_finite(s->prior_adhesion) || !tgi_finite(s->prior_resistance)) return TG_NOT_FINITE;
    for (int32_t k = 0; k < TG_SLOTS; k++) {
        if (!tgi_finite(s->offset[k])) return TG_NOT_FINITE;
        if (!tgi_positive(s->gain[k]) || !tgi_not_negative(s->noise[k]) || !tgi_not_negative(s->held_period[k])) return TG_NOT_POSITIVE;
    }
    return TG_OK;
}

static tg_status check(const tg_settings *s)
{
    if (s->machine.wheels < 1 || s->machine.wheels > TG_MAX_WHEELS || s->axles < 1 || s->axles > TG_MAX_WHEELS)
        return TG_BAD_ARGUMENT;
    if (s->method != TG_FILTERED && s->method != TG_ALGEBRAIC && s->method != TG_SPEEDS) return TG_BAD_ARGUMENT;
    tg_status status = check_wheels(s);
    return status == TG_OK ? check_numbers(s) : status;
}

/* Beyond these a value is a defect of the log, not a measurement. */
static tg_real plausible(int32_t slot)
{
    if (slot < TG_GROUND_SPEED) return (tg_real)1e4; /* rad/s */
    if (slot < TG_DRIVE_TORQUE) return (tg_real)1e3; /* m/s */
    if (slot < TG_ACCELERATION_X) return (tg_real)1e7; /* N m, N */
    if (slot < TG_PITCH) return (tg_real)1e3; /* m/s^2 */
    if (slot < TG_VERTICAL_LOAD) return (tg_real)1.5; /* rad */
    if (slot == TG_YAW_RATE) return 100; /* rad/s */
    return (tg_real)1e8; /* N, kg */
}

static int has_channel(const tg_settings *s, int32_t slot)
{
    const int32_t torque = slot - TG_DRIVE_TORQUE;
    if (slot < TG_GROUND_SPEED) return slot < s->machine.wheels;
    if (torque >= 0 && torque < TG_MAX_WHEELS) return torque < s->machine.wheels && s->driven[torque];
    if (slot == TG_MASS) return s->weighed;
    if (slot == TG_HITCH_LOAD) return s->carrying;
    return slot < TG_YAW_RATE ? slot - TG_VERTICAL_LOAD < s->axles : slot == TG_YAW_RATE || slot == TG_BRAKE;
}

/* Which wheels the watch looks at; on which side of the machine each is, how much it bears there, and which other one drives on its axle. */
static void place_wheels(const tg_settings *s, tgi_constants *c)
{
    int32_t any = 0;
    for (int32_t i = 0; i < s->machine.wheels; i++) any |= s->powered[i];
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        int32_t place = 0;
        c->twin[i] = i;
        c->lean[i] = tgi_square(s->lateral_share[i] / s->wheel_share[i]);
        for (int32_t j = 0; j < s->machine.wheels; j++) {
            if (s->wheel_axle[j] != s->wheel_axle[i]) continue;
            place += (j < i) - (j > i);
            if (j != i && s->driven[i] && s->driven[j]) c->twin[i] = j;
        }
        c->side[i] = place < 0 ? -1 : place > 0;
        c->watched[i] = !any || s->powered[i];
    }
}

/* Of a speed with this noise, the least share of a sample in a low-pass that leaves a quarter of the threshold of standstill as noise. */
static tg_real soon(tg_real threshold, tg_real noise)
{
    const tg_real ratio = tgi_square(threshold / (4 * noise));
    return ratio < 1 ? 2 * ratio / (1 + ratio) : 1;
}

static void work_out_constants(const tg_settings *s, tgi_constants *c)
{
    memset(c, 0, sizeof *c);
    const tg_machine *m = &s->machine;
    const tg_real weight = m->mass * m->gravity;
    for (int32_t k = 0; k < TG_SLOTS; k++) {
        c->limit[k] = has_channel(s, k) ? plausible(k) : -1;
        c->inverse_gain[k] = 1 / s->gain[k];
        c->variance[k] = tgi_square(s->noise[k]);
        c->holds |= s->held_period[k] > 0;
    }
    for (int32_t i = 0; i < m->wheels; i++) {
        const tg_real load = s->load_share[s->wheel_axle[i]] * s->wheel_share[i] * weight;
        c->agility[i] = s->tuned.agility * m->gravity / s->rolling_radius[i];
        c->soon[i] = soon(s->standstill_speed / s->rolling_radius[i], s->noise[TG_WHEEL_SPEED + i]);
        c->spin_inertia += m->inertia[i] / s->rolling_radius[i];
        c->mean_radius += s->rolling_radius[i] / (tg_real)m->wheels;
        c->outermost = tgi_max(c->outermost, tgi_fabs(s->wheel_side[i]));
        c->unknown_torque[i] = tgi_square(s->tuned.unknown_torque * m->radius[i] * load);
        c->least_load[i] = s->tuned.least_load * load;
    }
    c->agility[TG_GROUND_SPEED] = s->tuned.agility * m->gravity;
    c->soon[TG_GROUND_SPEED] = soon(s->standstill_speed, s->noise[TG_GROUND_SPEED]);
    c->trust = 1 / (1 + tgi_square(s->noise[TG_GROUND_SPEED] / s->standstill_speed));
    const tg_real T = natural_time(m);
    c->force_walk = force_walk(s);
    c->mounting_walk = s->tuned.mounting_walk / T;
    c->pace = tgi_pace(s);
    place_wheels(s, c);
    tgi_place_trends(s, c);
    c->unknown_pull = tgi_square(s->tuned.unknown_pull * weight);
    c->least_shock = c->variance[TG_ACCELERATION_X] + c->variance[TG_DRAWBAR_FORCE] * tgi_square(1 / m->mass);
    tg_real low = s->tuning.scales[0], high = low;
    for (int32_t b = 1; b < TG_MODES; b++) {
        if (s->tuning.scales[b] < low) low = s->tuning.scales[b];
        if (s->tuning.scales[b] > high) high = s->tuning.scales[b];
    }
    for (int32_t b = 0; b < TG_MODES && high > low; b++) c->scale_score[b] = tgi_log(s->tuning.scales[b] / low) / tgi_log(high / low);
}

/* A filter with the priors only. */
tg_status tgi_filter_anew(tg_filter *f, const tg_settings *s)
{
    const int32_t n = s->machine.wheels, nx = 2 * n + 2;
    tg_real x[TG_MAX_STATES] = {0}, P[TG_MAX_STATES * TG_MAX_STATES] = {0};
    for (int32_t i = 0; i < n; i++) {
        x[n + 1 + i] = s->prior_adhesion;
        P[i * nx + i] = 1;
        P[(n + 1 + i) * (nx + 1)] = tgi_square(s->prior_adhesion_std);
    }
    P[n * (nx + 1)] = 1;
    x[nx - 1] = s->prior_resistance;
    P[(nx - 1) * (nx + 1)] = tgi_square(s->prior_resistance_std);
    return tg_filter_init(f, &s->machine, &s->tuning, x, P);
}

/* The filter's moments as the belief. */
void tgi_believe(tg_estimator *e)
{
    const tg_filter *f = &e->filter;
    if (f->tuning.policy == TG_BANK) {
        tgi_bank_moments(f, e->belief.x, e->belief.P);
        return;
    }
    memcpy(e->belief.x, f->x, sizeof e->belief.x);
    tgi_covariance_of(f, e->belief.P);
}

size_t tg_estimator_size(int32_t policy)
{
    const size_t filter = tg_filter_size(policy);
    return filter ? offsetof(tg_estimator, filter) + filter : 0;
}

typedef char tgi_room_is_enough[sizeof(tg_estimator) <= TG_ESTIMATOR_ROOM ? 1 : -1];
typedef char tgi_fixed_room_is_enough[offsetof(tg_estimator, filter) + TG_FILTER_ROOM_FIXED <= TG_ESTIMATOR_ROOM_FIXED ? 1 : -1];

/* The machine and the tuning are checked by the filter. */
tg_status tg_estimator_init(tg_estimator *e, const tg_settings *settings)
{
    if (!e || !settings) return TG_BAD_ARGUMENT;
    tg_status status = check(settings);
    if (status != TG_OK) return status;
    status = tgi_filter_anew(&e->filter, settings); /* which changes nothing where it fails */
    if (status != TG_OK) return status;
    memset(e, 0, offsetof(tg_estimator, consider));
    e->track = NULL;
    e->settings = *settings;
    if (!(settings->standstill_speed > 0)) e->settings.standstill_speed = standstill_speed(settings);
    e->direction = 1;
    for (int32_t i = 0; i < settings->machine.wheels; i++) e->rolls |= (settings->method != TG_SPEEDS && !settings->powered[i] && !settings->driven[i]) << i;
    e->yaw_time = e->braked_time = e->unbraked_time = -(double)INFINITY;
    e->leap_time = (double)INFINITY;
    work_out_constants(&e->settings, &e->constants);
    e->shock = e->constants.least_shock;
    e->slope.error_variance = tgi_square(settings->slope_spread);
    tgi_reset_slips(e);
    e->warped.left = 1;
    for (int32_t k = 0; k < TG_SLOTS; k++) e->last_raw[k] = (tg_real)NAN;
    tgi_reset_curves(e);
    tgi_believe(e);
    const tg_input rest = {.load = {0}};
    e->belief.columns = tgi_deviations(e, &rest, e->belief.x);
    tg_consider_init(&e->consider, &e->filter, e->belief.columns);
    return TG_OK;
}

tg_status tg_estimator_settings(const tg_estimator *e, tg_settings *settings)
{
    if (!e || !settings) return TG_BAD_ARGUMENT;
    *settings = e->settings;
    return TG_OK;
}

tg_status tg_estimator_set_noise(tg_estimator *e, const tg_real *noise, const tg_real *held_period)
{
    if (!e || !noise || !held_period) return TG_BAD_ARGUMENT;
    tg_settings s = e->settings;
    memcpy(s.noise, noise, sizeof s.noise);
    memcpy(s.held_period, held_period, sizeof s.held_period);
    const tg_status status = check(&s);
    if (status != TG_OK) return status;
    e->settings = s;
    work_out_constants(&s, &e->constants);
    if (!e->seen_motion || e->shock < e->constants.least_shock) e->shock = e->constants.least_shock;
    return TG_OK;
}
