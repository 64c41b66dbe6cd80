/* Slip from speeds alone, where no torque is measured (docs/decisions/0110). The state is the ground speed v, its rate a, and of each
 * wheel the slip speed d = r omega - (v - side yaw_rate), in the vehicle's own directions: so both speeds are linear in it, and a wheel
 * that spins at rest is no special case (a steered wheel's hub moves faster than v - side yaw_rate, computed with the last v). a is an
 * Ornstein-Uhlenbeck process (Singer 1970), d a random walk in proportion to speed. How hard both are driven is not known: TG_SPEED_MODES
 * filters, one a pair of densities, are mixed as an interacting multiple model (Blom and Bar-Shalom 1988). The same in NumPy:
 * tests/estimation/kernel_twin/speeds.py. */
#include "estimator.h"

#define TG_LEVELS 3
#define SIZE TG_SPEED_STATES

typedef struct { /* what a row measures [m/s]: ground speed, rims; and which channels there are */
    tg_real y[TG_MAX_WHEELS + 1], variance[TG_MAX_WHEELS + 1];
    int32_t given[TG_MAX_WHEELS + 1], count; /* channels that are measured */
    int32_t confirmed;                       /* the last ground speed was as far off, to the same side */
} tgi_speed_samples;

typedef struct { /* how the samples fitted one mode */
    tg_real weight[TG_MAX_WHEELS + 1], nis[TG_MAX_WHEELS + 1], score;
} tgi_speed_fit;

/* Variance that the densities add over dt; the noise of slip speeds is in proportion to the speeds in `x`. */
static void disturb(const tg_tuned *k, const tg_real *x, tg_real (*P)[SIZE], tg_real dt, tg_real manoeuvre, tg_real slipping, int32_t n)
{
    P[0][0] += manoeuvre * dt * dt * dt / 3;
    P[0][1] += manoeuvre * dt * dt / 2;
    P[1][0] += manoeuvre * dt * dt / 2;
    P[1][1] += manoeuvre * dt;
    tg_real fast[TG_MAX_WHEELS];
    for (int32_t i = 0; i < n; i++) {
        const tg_real speed = tgi_fabs(x[0]), rim = tgi_fabs(x[0] + x[2 + i]);
        fast[i] = tgi_max(tgi_max(speed, rim), k->slowest);
        for (int32_t j = 0; j <= i; j++) {
            const tg_real added = (j < i ? 1 - k->apart : 1) * slipping * dt * fast[i] * fast[j];
            P[2 + i][2 + j] += added;
            if (j < i) P[2 + j][2 + i] += added;
        }
    }
}

/* Where the ground speed is reckoned, it and all slip speeds may have changed against each other by up to half of `change` [m/s] either way:
 * no rim shows it. */
static void loosen(tg_real (*P)[SIZE], tg_real change, int32_t n)
{
    const tg_real added = tgi_square(change) / 12;
    for (int32_t i = -1; i < n; i++)
        for (int32_t j = -1; j < n; j++) P[i < 0 ? 0 : 2 + i][j < 0 ? 0 : 2 + j] += (i < 0) == (j < 0) ? added : -added;
}

/* P becomes F P F' of a step: F differs from 1 in v' = v + reach a, a' = keep a. */
static void carry_on(tg_real (*P)[SIZE], tg_real reach, tg_real keep, int32_t size)
{
    for (int32_t j = 0; j < size; j++) {
        P[0][j] += reach * P[1][j];
        P[1][j] *= keep;
    }
    for (int32_t j = 0; j < size; j++) {
        P[j][0] += reach * P[j][1];
        P[j][1] *= keep;
    }
}

static void passage_of(tg_real dt, tg_real lasting, tg_real *reach, tg_real *keep)
{
    *reach = -lasting * tgi_expm1(-dt / lasting);
    *keep = tgi_exp(-dt / lasting);
}

/* Channel c measures v, a wheel v + d. */
TG_INLINE tg_real read_of(const tg_real *x, int32_t c) { return x[0] + (c ? x[1 + c] : 0); }

static tg_real spread(const tg_real (*P)[SIZE], int32_t c)
{
    return c ? P[0][0] + 2 * P[0][1 + c] + P[1 + c][1 + c] : P[0][0];
}

/* Update with the samples one after another. A sample beyond `huber` SDs of the prediction counts less, except a ground
 * speed that the next one confirms: rims alone would hold the estimate for ever where all wheels lose grip together. */
static void update(tgi_speed_mode *m, tgi_speed_fit *fit, const tgi_speed_samples *in, tg_real huber, int32_t size)
{
    for (int32_t k = 0; k < in->count; k++) {
        const int32_t c = in->given[k];
        const tg_real expected = tgi_sqrt(spread((const tg_real(*)[SIZE])m->P, c) + in->variance[c]);
        const tg_real off = tgi_fabs(in->y[c] - read_of(m->x, c));
        const int32_t soft = huber > 0 && off > huber * expected && !(c == 0 && in->confirmed);
        fit->weight[c] = soft ? huber * expected / off : 1;
    }
    for (int32_t k = 0; k < in->count; k++) {
        const int32_t c = in->given[k];
        tg_real column[SIZE];
        for (int32_t j = 0; j < size; j++) column[j] = m->P[j][0] + (c ? m->P[j][1 + c] : 0);
        const tg_real variance = read_of(column, c) + in->variance[c] / fit->weight[c], innovation = in->y[c] - read_of(m->x, c);
        for (int32_t i = 0; i < size; i++) {
            const tg_real gain = column[i] / variance;
            m->x[i] += gain * innovation;
            for (int32_t j = 0; j < size; j++) m->P[i][j] -= gain * column[j];
        }
        fit->nis[c] = innovation * innovation / variance; /* given the samples before it */
        fit->score -= (fit->nis[c] + tgi_log(variance)) / 2;
    }
}

/* The moments of all modes together. */
static void merge(tgi_speeds *s, const tgi_speed_mode *mode, int32_t size)
{
    memset(s->x, 0, sizeof s->x);
    memset(s->P, 0, sizeof s->P);
    for (int32_t m = 0; m < TG_SPEED_MODES; m++)
        for (int32_t i = 0; i < size; i++) s->x[i] += s->probability[m] * mode[m].x[i];
    for (int32_t m = 0; m < TG_SPEED_MODES; m++)
        for (int32_t i = 0; i < size; i++)
            for (int32_t j = 0; j < size; j++)
                s->P[i][j] += s->probability[m] * (mode[m].P[i][j] + (mode[m].x[i] - s->x[i]) * (mode[m].x[j] - s->x[j]));
}

/* Where a mode starts from: itself by `own`, all modes together by the rest. */
static void mix(tgi_speed_mode *m, const tgi_speeds *all, tg_real own, int32_t size)
{
    tg_real apart[SIZE], other[SIZE];
    for (int32_t i = 0; i < size; i++) {
        const tg_real x = own * m->x[i] + (1 - own) * all->x[i];
        apart[i] = m->x[i] - x;
        other[i] = all->x[i] - x;
        m->x[i] = x;
    }
    for (int32_t i = 0; i < size; i++)
        for (int32_t j = 0; j < size; j++)
            m->P[i][j] = own * (m->P[i][j] + apart[i] * apart[j]) + (1 - own) * (all->P[i][j] + other[i] * other[j]);
}

TG_INLINE void move(tg_real *x, tg_real reach, tg_real keep)
{
    x[0] += reach * x[1];
    x[1] *= keep;
}

static void step(tg_estimator *e, tg_real dt, tgi_speed_samples *in, tg_row *row)
{
    tgi_speeds *const s = &e->speeds;
    const int32_t n = e->settings.machine.wheels, size = n + 2;
    tgi_speed_fit fit[TG_SPEED_MODES];
    tg_real reach, keep, best = 0, sum = 0, weight[TG_MAX_WHEELS + 1] = {0}, scale[SIZE];
    const tg_tuned *const tuned = &e->settings.tuned;
    const tg_real stay = tgi_exp(-dt / tuned->mode_dwell), leave = -tgi_expm1(-dt / tuned->mode_dwell) / TG_SPEED_MODES;
    passage_of(dt, tuned->lasting, &reach, &keep);
    memcpy(scale, s->x, sizeof scale);
    move(scale, reach, keep);
    const tg_real side = in->y[0] > scale[0] ? 1 : -1;
    tg_real ahead = 0, square = 0; /* innovation of the ground speed by all modes, and its mean square */
    in->confirmed = !isnan(in->y[0]) && !row->reckoned && s->off == side;
    for (int32_t m = 0; m < TG_SPEED_MODES; m++) {
        tgi_speed_mode *const mode = &e->speed_mode[m];
        const tg_real prior = stay * s->probability[m] + leave;
        mix(mode, s, stay * s->probability[m] / prior, size);
        move(mode->x, reach, keep);
        carry_on(mode->P, reach, keep, size);
        disturb(tuned, scale, mode->P, dt, tuned->manoeuvre[m / TG_LEVELS], tuned->slipping[m % TG_LEVELS], n);
        if (row->reckoned) loosen(mode->P, tuned->agility * e->settings.machine.gravity * dt, n);
        const tg_real innovation = in->y[0] - mode->x[0];
        ahead += prior * innovation;
        square += prior * (tgi_square(innovation) + mode->P[0][0]);
        fit[m].score = tgi_log(prior);
        update(mode, &fit[m], in, e->settings.tuning.huber, size);
        if (m == 0 || fit[m].score > best) best = fit[m].score;
    }
    tgi_watch_innovation(e, row, ahead, square - tgi_square(ahead) + in->variance[0]);
    for (int32_t m = 0; m < TG_SPEED_MODES; m++) sum += s->probability[m] = tgi_exp(fit[m].score - best);
    s->manoeuvre = s->slipping = 0;
    const int32_t first = row->reckoned; /* of the measurements: the ground speed comes first, and a reckoned one is none */
    for (int32_t m = 0; m < TG_SPEED_MODES; m++) {
        const tg_real p = s->probability[m] /= sum;
        s->manoeuvre += p * tuned->manoeuvre[m / TG_LEVELS];
        s->slipping += p * tuned->slipping[m % TG_LEVELS];
        for (int32_t k = first; k < in->count; k++) {
            const int32_t c = in->given[k], place = c ? c - 1 : n; /* ground speed is first here, after the wheels elsewhere */
            if (m == 0) row->channel_nis[place] = 0;
            row->channel_nis[place] += p * fit[m].nis[c];
            e->belief.nis += p * fit[m].nis[c];
            weight[k] += p * fit[m].weight[c];
        }
    }
    for (int32_t k = first; k < in->count; k++) row->outlier |= weight[k] < e->settings.outlier_weight;
    if (!isnan(in->y[0]) && !row->reckoned) s->off = in->confirmed || weight[0] < e->settings.outlier_weight ? side : 0;
    merge(s, e->speed_mode, size);
}

/* The first row since nothing was known that measures any speed. What it does not measure follows from the rest, broadly. */
static void begin(tg_estimator *e, const tgi_speed_samples *in, int32_t n)
{
    tgi_speeds *const s = &e->speeds;
    const int32_t size = n + 2;
    tg_real v = 0;
    int32_t rims = 0;
    for (int32_t c = 1; c <= n; c++) {
        if (isnan(in->y[c])) continue;
        v += in->y[c];
        rims++;
    }
    if (rims > 0) v /= (tg_real)rims;
    if (!isnan(in->y[0])) v = in->y[0];
    else if (rims == 0) return;
    const tg_real broad = tgi_square((tg_real)0.3 * tgi_fabs(v) + (tg_real)0.1);
    memset(s->P, 0, sizeof s->P);
    s->x[0] = v;
    s->x[1] = 0;
    s->P[0][0] = isnan(in->y[0]) ? broad : in->variance[0];
    s->P[1][1] = tgi_square(e->settings.tuned.first_rate);
    for (int32_t c = 1; c <= n; c++) {
        const int32_t k = 1 + c;
        s->x[k] = isnan(in->y[c]) ? 0 : in->y[c] - v;
        if (!isnan(in->y[c]))
            for (int32_t j = 0; j < size; j++) s->P[k][j] = s->P[j][k] = -s->P[0][j];
        s->P[k][k] = isnan(in->y[c]) ? broad : s->P[0][0] + in->variance[c];
    }
    for (int32_t m = 0; m < TG_SPEED_MODES; m++) {
        memcpy(e->speed_mode[m].x, s->x, sizeof s->x);
        memcpy(e->speed_mode[m].P, s->P, sizeof s->P);
    }
    s->begun = 1;
}

/* Nothing is known of the motion. */
static void forget(tg_estimator *e)
{
    memset(&e->speeds, 0, sizeof e->speeds);
    memset(e->speed_mode, 0, sizeof e->speed_mode);
    e->speeds.anew = 1;
    for (int32_t m = 0; m < TG_SPEED_MODES; m++) e->speeds.probability[m] = (tg_real)1 / TG_SPEED_MODES;
}

/* Rims that read 0 while the vehicle moves: no locked wheels, but a sensor's dead band at low speed. */
static int32_t rims_are_blind(const tg_estimator *e, const tg_row *row, int32_t *any)
{
    const tg_settings *s = &e->settings;
    *any = 0;
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        const tg_real omega = row->value[TG_WHEEL_SPEED + i];
        if (isnan(omega)) continue;
        *any = 1;
        if (s->rolling_radius[i] * tgi_fabs(omega) > s->dead_band) return 0;
    }
    return *any && !e->standing;
}

static void samples_of(const tg_estimator *e, const tg_row *row, const tgi_speeds *s, tgi_speed_samples *in)
{
    const tg_settings *set = &e->settings;
    const tg_real lean = tgi_square(set->noise[TG_YAW_RATE]);
    const int32_t n = set->machine.wheels;
    tg_real extra[TG_MAX_WHEELS]; /* what steered hubs go faster than along the vehicle */
    const tg_real ground = s->begun != 0 || isnan(row->value[TG_GROUND_SPEED]) ? s->x[0] : row->value[TG_GROUND_SPEED];
    in->count = 0;
    in->y[0] = row->value[TG_GROUND_SPEED];
    in->variance[0] = row->ground_variance;
    for (int32_t i = 0; i < n; i += TG_LANES) {
        const tg_lanes along = ground - lanes_load(set->wheel_side + i) * s->yaw;
        lanes_store(extra + i, tgi_hub_of(along, lanes_load(set->wheel_ahead + i) * s->yaw) - along);
    }
    for (int32_t i = 0; i < n; i++) {
        const tg_real r = set->rolling_radius[i], side = set->wheel_side[i];
        in->y[1 + i] = s->open != 0 ? (tg_real)NAN : r * row->value[TG_WHEEL_SPEED + i] + side * s->yaw - extra[i];
        in->variance[1 + i] = r * r * e->constants.variance[TG_WHEEL_SPEED + i] + (s->yaw != 0 ? side * side * lean : 0);
    }
    for (int32_t c = 0; c <= n; c++)
        if (!isnan(in->y[c])) in->given[in->count++] = c;
}

/* Whether nothing determines slip, now or since the motion began. */
static int32_t is_blind(const tgi_speeds *s, int32_t n)
{
    int32_t wheel = 0;
    for (int32_t i = 0; i < n; i++) wheel |= s->seen[1 + i] != 0;
    return s->seen[0] == 0 || !wheel || s->open != 0;
}

/* The row's values from the state; the radius is considered: it shifts slip, and no sample shows it. */
static void report(const tg_settings *set, const tgi_speeds *s, tg_real *o)
{
    const tg_real error = set->uncertainty.wheel_radius, nan = (tg_real)NAN;
    const int32_t known = s->begun != 0;
    const tg_real off = tgi_square(set->ground_speed_delay * s->x[1]) + s->slow; /* of the ground speed alone: the rims are measured by themselves */
    o[TG_OUT_GROUND_SPEED] = known ? s->x[0] : nan;
    o[TG_OUT_GROUND_SPEED_STD] = known ? tgi_root(s->P[0][0] + off) : nan;
    const int32_t n = set->machine.wheels, slips = known && s->open == 0 && s->standing == 0;
    for (int32_t i = 0; i < n; i += TG_LANES) {
        const int32_t k = 2 + i;
        const tg_lanes r = lanes_load(set->rolling_radius + i), d = lanes_load(s->x + k), vd = lanes_load(s->P[0] + k);
        const tg_lanes dd = lanes_of(s->P[k][k], s->P[k + 1][k + 1], s->P[k + 2][k + 2], s->P[k + 3][k + 3]);
        const tg_lanes hub = tgi_hub_of(s->x[0] - lanes_load(set->wheel_side + i) * s->yaw, lanes_load(set->wheel_ahead + i) * s->yaw);
        const tg_lanes omega = (hub + d) / r, turn = tgi_turn_variance(set, i, omega, s->x[0], s->unseen_turn);
        const tg_real vv = s->P[0][0];
        const tg_lanes wv = (vv + vd) / r, ww = (vv + 2 * vd + dd) / (r * r);
        const tgi_slip g = tgi_slip_of(omega, hub, r, set->standstill_speed);
        const tg_lanes by_radius = g.radius * error;
        const tg_lanes variance = g.wheel * (g.wheel * ww + 2 * g.ground * wv) + g.ground * g.ground * (vv + off) + turn + by_radius * by_radius;
        for (int32_t j = 0; j < TG_LANES && i + j < n; j++) {
            o[TG_OUT_WHEEL_SPEED + i + j] = known ? omega[j] : nan;
            o[TG_OUT_WHEEL_SPEED_STD + i + j] = known ? tgi_root(ww[j]) : nan;
            o[TG_OUT_SLIP + i + j] = slips ? g.slip[j] : nan;
            o[TG_OUT_SLIP_STD + i + j] = slips ? tgi_root(variance[j] < 1 ? variance[j] : 1) : nan;
            o[TG_OUT_ZERO_SLIP_RADIUS + i + j] = r[j];
            o[TG_OUT_ZERO_SLIP_RADIUS_STD + i + j] = r[j] * error;
        }
    }
}

/* A checked row of the method TG_SPEEDS. */
void tgi_speeds_update(tg_estimator *e, tg_row *row, tg_estimate *out)
{
    tgi_speeds *const s = &e->speeds;
    const int32_t n = e->settings.machine.wheels;
    const tg_real dt = e->started ? (tg_real)(row->time - e->time) : 0, travelled = tgi_fabs(s->x[0]);
    const int32_t gap = !e->started || row->time - e->measured_time > (double)e->settings.gap;
    int32_t any;
    tgi_speed_samples in;
    tgi_track_motion(e, row);
    tgi_track_turn(e, row);
    if (gap) forget(e);
    else s->anew = 0;
    s->dt = dt;
    s->yaw = e->yaw_rate;
    s->unseen_turn = e->unseen_turn;
    s->standing = (tg_real)e->standing;
    const int32_t blind = rims_are_blind(e, row, &any);
    if (any || e->standing) s->open = (tg_real)blind;
    if (e->standing) tgi_rest_reading(e, row);
    else tgi_rest_over(e);
    if (!e->started) e->ground_time = row->time;
    tgi_hold_update(e, &e->ground, row, TG_GROUND_SPEED, 0);
    tgi_reckon_speeds(e, dt, row);
    samples_of(e, row, s, &in);
    e->belief.nis = 0;
    if (s->begun != 0) step(e, dt, &in, row);
    else begin(e, &in, n);
    e->belief.channels = in.count - row->reckoned;
    for (int32_t k = row->reckoned; k < in.count; k++) s->seen[in.given[k]] = 1;
    if (!gap && !e->standing) tgi_remember_speeds(e, row, dt);
    if (!gap && !e->standing) e->distance += (double)((travelled + tgi_fabs(s->x[0])) / 2 * dt);
    const int32_t first = !e->started;
    tgi_end_row(e, row, out);

    s->slow = tgi_slow_variance(e) + tgi_alike_variance(e) + tgi_max(e->scene.reckoned - s->P[0][0], 0);
    report(&e->settings, s, out->value);
    const int32_t open = is_blind(s, n);
    e->scene.late = tgi_square(e->settings.ground_speed_delay * s->x[1]) + s->slow;
    for (int32_t i = 0; i < n; i += TG_LANES)
        lanes_store(e->scene.turn + i, tgi_turn_variance(&e->settings, i, lanes_load(out->value + TG_OUT_WHEEL_SPEED + i), s->x[0], s->unseen_turn));
    tgi_watch_over(e, row, 0, !open, gap || open, dt, out->value);
    out->event = tgi_event_of(e, row, (gap && !first) || open, 0);
}

/* ---- smoothing: a row's record is its tgi_speeds ---- */

size_t tgi_speeds_length(void) { return sizeof(tgi_speeds) / sizeof(tg_real); }

/* Rauch, Tung and Striebel (1965), with the densities that the row behind was reached by. */
static void step_back(const tg_tuned *tuned, tgi_speeds *here, const tgi_speeds *filtered_next, const tgi_speeds *next, int32_t n)
{
    const int32_t size = n + 2;
    tg_real ahead[SIZE][SIZE], factor[SIZE][SIZE], gain[SIZE][SIZE], change[SIZE], x[SIZE], reach, keep;
    passage_of(filtered_next->dt, tuned->lasting, &reach, &keep);
    memcpy(ahead, here->P, sizeof ahead);
    memcpy(gain, here->P, sizeof gain);
    carry_on(ahead, reach, keep, size);
    for (int32_t j = 0; j < size; j++) move(gain[j], reach, keep); /* P F', which times inverse(ahead) is the gain */
    memcpy(x, here->x, sizeof x);
    move(x, reach, keep);
    disturb(tuned, x, ahead, filtered_next->dt, filtered_next->manoeuvre, filtered_next->slipping, n);
    for (int32_t j = 0; j < size; j++) change[j] = next->x[j] - x[j];
    memcpy(factor, ahead, sizeof factor);
    if (!tgi_divide_rows(size, SIZE, factor[0], gain[0])) return;
    for (int32_t i = 0; i < size; i++)
        for (int32_t k = 0; k < size; k++) here->x[i] += gain[i][k] * change[k];
    for (int32_t i = 0; i < size; i++)
        for (int32_t j = 0; j < size; j++)
            for (int32_t k = 0; k < size; k++)
                for (int32_t l = 0; l < size; l++) here->P[i][j] += gain[i][k] * (next->P[k][l] - ahead[k][l]) * gain[j][l];
}

/* One row back: `carry` holds the smoothed row behind and is overwritten by this one's; `next` is the filtered one behind, or null. */
void tgi_speeds_smooth(const tg_settings *set, const tg_real *record, const tg_real *next, tg_real *carry, tg_real *o)
{
    tgi_speeds here, behind, smoothed;
    memcpy(&here, record, sizeof here);
    if (next) {
        memcpy(&behind, next, sizeof behind);
        memcpy(&smoothed, carry, sizeof smoothed);
        if (behind.anew == 0) step_back(&set->tuned, &here, &behind, &smoothed, set->machine.wheels);
    }
    memcpy(carry, &here, sizeof here);
    report(set, &here, o);
}
