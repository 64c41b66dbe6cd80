/* Inputs of the model: held between their samples, and the noise that holding them makes. */
#include "estimator.h"

#define TG_LEAST_SAMPLES 4 /* before any can be called a spike */
#define TG_PAUSE 10        /* intervals, beyond a gap: a longer silence is a pause */
#define TG_CHATTER ((tg_real)2 / 3)
#define TG_PRESSED ((tg_real)0.05) /* of a brake's whole way or pressure: less is its play, or its sensor's zero */
#define TG_BRAKE_TIME 0.25 /* s that a brake acts after it is let go, and in which adhesion changes by its prior SD */
#define TG_AHEAD 4 /* intervals that the change over one of them is continued at most: of two samples at nearly one instant it is their noise */

/* An input itself is filtered as a random walk in noise, with a time constant of at most `lag`: between two wheel speeds a raw
 * torque's noise would shake omega more than the wheel ever does. */
static void track(tg_hold *h, tg_real x, tg_real noise, tg_real interval, tg_real lag)
{
    tg_real prior = h->variance + tgi_motion(h, noise), gain = prior / (prior + noise * noise);
    const tg_real least = interval / (lag + interval);
    if (!(gain > least)) gain = least;
    h->value += gain * (x - h->value);
    h->variance = gain * noise * noise;
}

/* The value before a sample that follows a spike: the spike's own where the sample confirms it, else the last one that was none. */
static tg_real before_spike(const tg_hold *h, tg_real x)
{
    return h->spike > 0 && tgi_fabs(x - h->raw) < tgi_fabs(x - h->calm) ? h->raw : h->calm;
}

/* The first sample, or the first after a pause, which is no increment: nothing shows what came before it. */
static void begin(tg_hold *h, tg_real x, tg_real noise)
{
    h->value = h->calm = x;
    h->variance = noise * noise;
    h->rate = h->bend = h->spike = 0;
}

/* Add the row's sample at `slot`, if it has one. The mean square of the input's increments is kept over
 * about 1 s; one far beyond it is a spike: until the next sample confirms it, the value before it is kept, its square counts as uncertainty,
 * and it enters the mean square clipped. `rate`: the change a second that is no spike, 0 where it is not known; it counts over the usual
 * interval at most, since within a gap nearly everything is possible. Where it is known, of a speed, a spike is one from the first samples on,
 * else only once the increments are known, and what drives the model between samples is worked out. Increments of a standstill show nothing
 * of the start. */
void tgi_hold_update(const tg_estimator *e, tg_hold *h, const tg_row *row, int32_t slot, tg_real rate)
{
    const tg_tuned *const k = &e->settings.tuned;
    const int32_t moving = !e->standing;
    const tg_real x = row->value[slot], noise = e->settings.noise[slot], interval = (tg_real)(row->time - h->time);
    if (isnan(x)) return;
    if (h->count == 0 || interval > e->settings.gap + TG_PAUSE * h->interval) begin(h, x, noise);
    else {
        const tg_real before = before_spike(h, x), most = k->spike * k->spike * (h->level + noise * noise);
        const tg_real usual = h->interval > 0 && h->interval < interval ? h->interval : interval;
        tg_real change = tgi_square(x - before);
        h->spike = 0;
        if ((h->count > TG_LEAST_SAMPLES || rate > 0) && change > most + tgi_square(rate * usual)) {
            h->spike = change;
            h->calm = before;
            change = most;
        } else {
            if (!(rate > 0)) track(h, x, noise, interval, k->input_lag);
            h->calm = x;
            const tg_real ahead = TG_AHEAD * h->interval;
            h->bend = h->count > 1 ? tgi_square(x - before - h->rate * (interval < ahead ? interval : ahead)) : 0;
            h->rate = (x - before) / interval;
        }
        tg_real memory = interval / (k->increment_memory + interval);
        if (memory * (tg_real)h->count < 1) memory = 1 / (tg_real)h->count; /* a plain mean at first */
        if (moving) h->level += memory * (change - h->level);
        if (moving && !(h->spike > 0)) h->bends += memory * (h->bend - h->bends);
        h->interval = interval;
    }
    h->raw = x;
    h->time = row->time;
    h->since = e->started ? e->time : row->time;
    if (h->count == 0 || (moving && h->count < 100)) h->count++;
}

/* The leap was the vehicle's own. */
static void believe_leap(tg_hold *h)
{
    h->bend = h->spike;
    h->rate = (h->raw - h->calm) / h->interval;
    h->value = h->calm = h->raw;
    h->spike = 0;
}

/* Alike to a factor of two, either way, as the sides of a turn on the spot go; 0 is no leap. */
static int32_t alike(tg_real one, tg_real other)
{
    const tg_real twice = 2 * tgi_fabs(one * other);
    return twice > tgi_square(one) && twice > tgi_square(other);
}

/* Of `among` inputs of the wheels, leaps of most at the same instant that are alike are a manoeuvre, no spikes. `rate`: what each is capable of
 * in a second, where that is known. Of `torques`, given whose they are, those of the two wheels of an axle suffice if they go one way, since an
 * axle crosses a border of soils alone, unless they leap to 0, as a lost message is read, or are shares of one signal. */
void tgi_judge_leaps(tg_hold *h, const tg_real *rate, const tg_estimator *torques, int32_t wheels, int32_t among, double time)
{
    tg_real leap[8];
    int32_t leaps = 0;
    for (int32_t i = 0; i < wheels; i++) {
        const int32_t leapt = h[i].spike > 0 && h[i].time == time && (!rate || h[i].spike < tgi_square(rate[i] * h[i].interval));
        leap[i] = leapt ? h[i].raw - h[i].calm : 0;
        leaps += leap[i] != 0;
    }
    if (leaps < 2) return;
    for (int32_t i = 0; i < wheels; i++) {
        const int32_t twin = torques ? torques->constants.twin[i] : i;
        int32_t count = 0;
        for (int32_t j = 0; j < wheels; j++) count += alike(leap[i], leap[j]);
        const int32_t border =
            twin != i && torques->shared[i] != TG_SAME && h[i].raw != 0 && leap[i] * leap[twin] > 0 && alike(leap[i], leap[twin]);
        if ((count > 1 && 2 * count > among) || border) believe_leap(&h[i]);
    }
}

/* Error of one input as extra variance of its state over the `step` (s) that ends at `time`, the last of the `used` s in which the state moves
 * by the input's last sample. A step in which a sample comes uses it whole: a wheel's slip settles within milliseconds, so that the torque of
 * an instant is the adhesion of that instant (docs/decisions/0096). Its error is the sample's noise, and what the input does beside the
 * straight line since the last one: a ramp does nothing; an input that walks at random (Brownian bridge) or jumps at some instant in between
 * adds the twelfth of its squared increment, and its second difference has two of these squares, and six of the noise. The error stays the same
 * until the next sample, so that it has moved the state by (error used), and this step adds error^2 (used^2 - (used - step)^2). From its
 * sample on the input continues as a random walk w, of whose integral the variance is w age^3/3. `unknown` is the variance before the first
 * sample and once the last one is older than a gap. */
static tg_real held_noise(const tg_estimator *e, const tg_hold *h, double time, tg_real step, tg_real used, tg_real noise, tg_real unknown)
{
    const tg_real age = (tg_real)(time - h->time);
    const int32_t comes = age < step;
    if (h->count == 0 || (h->count == 1 && comes)) return step * unknown; /* over the step before its first sample, too */
    if (comes) used = step;
    const tg_real since = comes ? 0 : age - step, walked = h->spike > 0 && comes ? step : age;
    tg_real constant = noise * noise + h->spike + (age > e->settings.gap ? unknown : 0);
    if (comes && !(h->spike > 0)) {
        const tg_real bend = (h->bend > h->bends ? h->bend : h->bends) / 2 - 3 * noise * noise, over = step < h->interval ? step : h->interval;
        if (bend > 0) constant += bend * over / (12 * h->interval);
    }
    return step * (2 * used - step) * constant + tgi_walk(h, noise) * (walked * walked * walked - since * since * since) / 3;
}

/* Factor on the random walks in use: of the bank the mean over its modes, as they may have changed in dt. */
static tg_real scale_of_walks(const tg_estimator *e, tg_real dt)
{
    const tg_tuning *t = &e->settings.tuning;
    if (t->policy != TG_BANK) return 1;
    const tg_real leave = -tgi_expm1(-dt / t->dwell);
    tg_real mean = 0;
    for (int32_t b = 0; b < TG_MODES; b++) {
        const tg_real p = e->filter.policy.bank.probability[b];
        mean += t->scales[b] * (p * (1 - leave) + (1 - p) * leave / (TG_MODES - 1));
    }
    return mean;
}

/* Walk of rho_s by hills, 1/s: where nothing shows the slope, rho_s contains it (docs/decisions/0149). As far as ground speeds disagree
 * with the forces; and no part of Q, whose scale in a bank follows the wheels' adhesions. */
static tg_real unseen_hills(const tg_estimator *e)
{
    if (e->pitch.count > 0 || e->slope.running) return 0;
    const tg_real walk = e->settings.tuned.terrain_walk * tgi_fabs(e->belief.x[e->settings.machine.wheels + 1]) / e->constants.mean_radius;
    return walk * tgi_alike_share(e);
}

/* What adhesion and resistance, walking at random within the step, do to the ground speed in it: a third of the walk times dt^2. The filter
 * itself lets them walk after the step, which at 1 Hz would make an outlier of every start. */
static tg_real walking_forces(const tg_estimator *e, const tg_drive *drive, tg_real hills, tg_real dt)
{
    const tg_settings *s = &e->settings;
    const int32_t n = s->machine.wheels;
    tg_real walk = s->tuning.walk[2 * n + 1] * tgi_square(s->machine.gravity);
    for (int32_t i = 0; i < n; i++) walk += s->tuning.walk[n + 1 + i] * tgi_square(e->held.load[i] * drive->inverse_mass);
    return (scale_of_walks(e, dt) * walk + hills * tgi_square(s->machine.gravity)) * dt * dt * dt / 3;
}

/* Variance of the change of a wheel's speed from one sample to the next that the third reverses, beyond its white noise; 0 below
 * TG_CHATTER of the whole change. An adhesion that follows so fast an oscillation is half a sample late, and farther from the truth than
 * its mean. White noise, whatever its size, has one half (docs/decisions/0026). */
static tg_real chatter(const tg_hold *h, tg_real noise)
{
    const tg_real back = h->bends / 2 - h->level, white = tgi_square(noise);
    return back > TG_CHATTER * h->level && back > 4 * white ? back - white : 0;
}

/* A brake, pressed or just let go, acts with a torque that no channel shows: while it does, adhesion follows the vehicle's motion alone.
 * What it did before its first sample went into rho_s, which is then unsure by twice its change since the sample before: it follows late. So
 * are, to a smoother, the rows between the two; after a gap the channel reports changes, and missed none. */
static void watch_brake(tg_estimator *e, tg_row *row)
{
    const tg_real share = row->value[TG_BRAKE], rho = e->belief.x[e->settings.machine.wheels];
    row->missed_braking = 0;
    if (!isnan(share)) {
        if (share > TG_PRESSED && !e->pressed) row->missed_braking = tgi_square(2 * (rho - e->unbraked));
        e->pressed = share > TG_PRESSED;
        e->scene.unsaid = row->time - e->unbraked_time > (double)e->settings.gap ? 0 : row->missed_braking;
        e->unbraked = rho;
        e->unbraked_time = row->time;
    }
    if (e->pressed) e->braked_time = row->time;
    e->braked = row->time - e->braked_time <= TG_BRAKE_TIME;
}

static void brake_noise(const tg_estimator *e, const tg_row *row, tg_real dt, tg_real *q)
{
    const int32_t n = e->settings.machine.wheels;
    const tg_real share = row->missed_braking > 0 ? 1 : dt / (tg_real)TG_BRAKE_TIME;
    q[2 * n + 1] += row->missed_braking;
    for (int32_t i = 0; i < n; i++) {
        q[i] += 2 * e->settings.gap * e->own_time[i].step * e->constants.unknown_torque[i] * tgi_square(e->filter.inverse_inertia[i]);
        q[n + 1 + i] += tgi_square(e->settings.prior_adhesion_std) * share;
    }
}

/* Whether it turns on the spot, its sides going against each other: the soil holds one back and pushes the other on, so that the vehicle as a
 * whole is not held back. */
int32_t tgi_on_the_spot(const tg_estimator *e)
{
    const tg_settings *s = &e->settings;
    const int32_t n = s->machine.wheels;
    const tg_real side = e->constants.outermost * tgi_fabs(e->yaw_rate);
    if (s->method != TG_FILTERED || side <= tgi_fabs(e->belief.x[n + 1]) || side < s->standstill_speed) return 0;
    tg_real ahead = 0, back = 0; /* a vehicle that is stuck has a rate of turn of noise, and wheels that turn one way */
    for (int32_t i = 0; i < n; i++) {
        const tg_real rim = tgi_rolls(e, i) ? 0 : s->rolling_radius[i] * e->belief.x[n + 2 + i];
        ahead = tgi_max(ahead, rim);
        back = tgi_max(back, -rim);
    }
    return ahead > s->standstill_speed && back > s->standstill_speed;
}

/* Not to the last: a force that lasts from one ground speed to the next, at most about a second, (m/s^2)^2 s. */
static tg_real spot_force(const tg_estimator *e)
{
    if (!tgi_on_the_spot(e)) return 0;
    return tgi_square(e->belief.x[e->settings.machine.wheels] * e->settings.machine.gravity) * (e->ground.interval < 1 ? e->ground.interval : 1);
}

/* Input noise of the step that ends at `time`, from the inputs as they stood over it (physics.md 1: torque moves omega, drawbar
 * force and slope move v). */
void tgi_input_noise(const tg_estimator *e, const tg_drive *drive, tg_real dt, tg_row *row, tg_real *q)
{
    const double time = row->time;
    const tg_settings *s = &e->settings;
    const tgi_constants *c = &e->constants;
    const int32_t n = s->machine.wheels;
    const tg_real hills = unseen_hills(e);
    for (int32_t j = 0; j < TG_MAX_STATES; j++) q[j] = 0;
    q[n] = walking_forces(e, drive, hills, dt) + spot_force(e) * dt + drive->drift_by_slope;
    q[2 * n + 1] = hills * dt;
    for (int32_t i = 0; i < n; i++) {
        row->chatter[i] = chatter(&e->wheel[i], s->noise[TG_WHEEL_SPEED + i]);
        if (row->chatter[i] > 0 && e->wheel[i].count > TG_LEAST_SAMPLES) q[i] = row->chatter[i] * e->own_time[i].step / e->wheel[i].interval;
    }
    for (int32_t i = 0; i < n; i++)
        if (s->driven[i])
            q[i] += held_noise(e, &e->torque[i], time, e->own_time[i].step, (tg_real)(time - e->own_time[i].torque), s->noise[TG_DRIVE_TORQUE + i], c->unknown_torque[i])
                 * tgi_square(e->filter.inverse_inertia[i]);
    if (e->drawbar.count > 0 || s->towing)
        q[n] += held_noise(e, &e->drawbar, time, dt, (tg_real)(time - e->drawbar.since), s->noise[TG_DRAWBAR_FORCE], c->unknown_pull) * tgi_square(drive->inverse_mass);
    if (e->braked) brake_noise(e, row, dt, q);
    if (e->pitch.count > 0)
        q[n] += held_noise(e, &e->pitch, time, dt, (tg_real)(time - e->pitch.since), s->noise[TG_PITCH], tgi_square(s->tuned.unknown_slope)) * tgi_square(s->machine.gravity);
}

void tgi_update_inputs(tg_estimator *e, tg_row *row, tg_real dt, tg_drive *drive)
{
    const tg_settings *s = &e->settings;
    int32_t driven = 0;
    memset(drive, 0, sizeof *drive);
    e->scene.unsaid = -1;
    if (e->braked || !isnan(row->value[TG_BRAKE])) watch_brake(e, row);
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        if (!s->driven[i]) continue;
        tgi_hold_update(e, &e->torque[i], row, TG_DRIVE_TORQUE + i, 0);
        driven++;
    }
    tgi_judge_leaps(e->torque, NULL, e, s->machine.wheels, driven, row->time);
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        if (!s->driven[i]) continue;
        const tg_hold *const h = &e->torque[i];
        drive->torque[i] = h->calm;
        row->outlier |= h->spike > 0;
    }
    tgi_hold_update(e, &e->drawbar, row, TG_DRAWBAR_FORCE, 0);
    tgi_hold_update(e, &e->pitch, row, TG_PITCH, 0);
    row->outlier |= e->drawbar.spike > 0;
    drive->drawbar = e->drawbar.calm;
    drive->calm_drawbar = e->drawbar.value;
    tgi_weigh(e, row, drive);
    tgi_slope_update(e, row, e->pitch.value, dt, drive);
    drive->cosine = tgi_cos(drive->slope);
    drive->sine = tgi_sin(drive->slope);
}

void tgi_along(const tg_estimator *e, const tg_drive *drive, tg_input *u)
{
    const tg_real d = (tg_real)e->direction;
    memset(u, 0, sizeof *u);
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) {
        u->torque[i] = d * drive->torque[i];
        u->load[i] = drive->load[i];
    }
    u->drawbar = d * drive->drawbar;
    u->slope = d * drive->slope;
    u->mass = e->mass.count > 0 ? drive->mass : 0;
    u->hitch_load = drive->hitch_load;
}

/* Not measured for longer than a gap and TG_PAUSE of its intervals (of at most half a gap), or not yet. */
static int32_t is_silent(const tg_estimator *e, const tg_hold *h, double time)
{
    const tg_real gap = e->settings.gap, most = gap / 2;
    if (h->count == 0) return 1;
    return time - h->time > (double)gap && time - h->time > (double)(gap + TG_PAUSE * (h->interval < most ? h->interval : most));
}

/* Whether the ground speed is silent while the vehicle drives: it is reckoned. */
int32_t tgi_ground_is_silent(const tg_estimator *e, double time)
{
    return !e->standing && e->seen_motion && time - e->ground_time > (double)e->settings.gap && is_silent(e, &e->ground, time);
}

/* Which wheels' speeds (2) or drive torques (1) are silent while the vehicle drives and others are measured, and whether any is, or a
 * drawbar force that was measured before: the thrust or pull that is unknown then and the soil's resistance look alike. Of a wheel
 * without a speed there is no slip. */
void tgi_find_silent(tg_estimator *e, double time)
{
    const tg_settings *s = &e->settings;
    const int32_t exempt = e->standing || !e->seen_motion || time - e->measured_time > (double)s->gap;
    int32_t silent = !exempt && e->drawbar.count > 0 && is_silent(e, &e->drawbar, time);
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        const int32_t speed = is_silent(e, &e->wheel[i], time) && !tgi_rolls(e, i), torque = s->driven[i] && is_silent(e, &e->torque[i], time);
        e->scene.silent[i] = exempt ? 0 : speed ? 2 : (tg_real)torque;
        silent |= e->scene.silent[i] > 0;
    }
    e->scene.any_silent = (tg_real)silent;
}
