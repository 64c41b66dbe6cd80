/* One raw sample in, one row of estimates out. */
#include "estimator.h"

#define TG_BATCH 32
#define TG_NO_TIME ((tg_real)1e-6) /* s */

/* ---- the filter ---- */

/* Considered columns, and a smoother's track, go along with whatever the filter just did. */
static void follow(tg_estimator *e, const tg_deviation *deviation)
{
    tg_consider_step(&e->consider, &e->filter, deviation);
    if (e->track) tg_track_step(e->track, &e->filter);
}

/* A filter that has lost its way knows the priors again. */
static void forget(tg_estimator *e)
{
    tgi_filter_anew(&e->filter, &e->consider, &e->settings);
    if (e->track) tg_track_init(e->track, &e->filter);
    e->scene.anew = 1;
}

/* Start the outputs anew at `outputs`, the parameters having walked for `walk` seconds. */
static void restart(tg_estimator *e, tg_real walk, const tg_real *outputs, const tg_real *variances)
{
    if (walk > e->settings.tuned.longest_walk) walk = e->settings.tuned.longest_walk;
    if (tg_filter_restart(&e->filter, walk, outputs, variances) != TG_OK) {
        forget(e);
        tg_filter_restart(&e->filter, 0, outputs, variances);
    }
    follow(e, NULL);
}

/* Outputs as this row measures them, along the travel. What it does not measure follows from the rest, broadly: a wheel from the
 * ground speed, the ground speed from the wheels or, but for a `start` from rest or a turn of direction, from what it just was. */
static void restart_from(tg_estimator *e, const tg_row *row, int32_t start, tg_real walk)
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
    int32_t late = !start && isnan(v) && e->ground_speed.seen && row->time - e->ground_speed.time <= 1;
    if (late) v = e->ground_speed.value;
    else if (isnan(v)) v = seen ? rim / (tg_real)seen : 0;
    tg_real broad = tgi_square((tg_real)0.3 * tgi_fabs(v) + (tg_real)0.1), noise = tgi_square(s->noise[TG_GROUND_SPEED]) + row->doubt[n];
    x[n] = d * v;
    P[n] = isnan(y[TG_GROUND_SPEED]) ? (late ? noise + (tg_real)0.01 : broad) : noise;
    for (int32_t i = 0; i < n; i++) {
        tg_real omega = y[TG_WHEEL_SPEED + i], r = s->rolling_radius[i];
        x[i] = d * (isnan(omega) ? v / r : omega);
        P[i] = isnan(omega) ? broad / (r * r) : tgi_square(s->noise[TG_WHEEL_SPEED + i]) + row->doubt[i];
    }
    restart(e, walk, x, P);
}

/* What adhesion was before a standstill or a turn of direction says little of the start: it is as unknown as at first. No time passes, but
 * the filter takes a time above 0. */
static void unknown_adhesion(tg_estimator *e)
{
    const int32_t n = e->settings.machine.wheels;
    tg_real q[TG_MAX_STATES] = {0};
    for (int32_t i = 0; i < n; i++) q[n + 1 + i] = tgi_square(e->settings.prior_adhesion_std);
    if (tg_filter_predict(&e->filter, TG_NO_TIME, &e->held, q) == TG_OK) follow(e, NULL);
}

/* At standstill the low-passed speeds stand for the outputs. */
static void rest(tg_estimator *e)
{
    const tg_settings *s = &e->settings;
    const int32_t n = s->machine.wheels;
    tg_real d = (tg_real)e->direction, x[9], P[9];
    for (int32_t i = 0; i < n; i++) {
        x[i] = d * e->wheel_speed[i].value;
        P[i] = tgi_square(s->noise[TG_WHEEL_SPEED + i]);
    }
    x[n] = d * e->ground_speed.value;
    P[n] = tgi_square(s->noise[TG_GROUND_SPEED]);
    restart(e, 0, x, P);
}

/* Nothing measured for too long: the estimate stays and its spread grows, since old torques must not be integrated. */
static void drift(tg_estimator *e, tg_real dt)
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

/* The row's channels along the travel, and their variances. The accelerometer's jolts come in swings, not as white noise, and so count
 * TG_SWING times. */
static void measured(const tg_estimator *e, const tg_row *row, tg_real *y, tg_real *r)
{
    const int32_t n = e->settings.machine.wheels;
    const tg_real d = (tg_real)e->direction;
    for (int32_t i = 0; i < n; i++) {
        y[i] = d * row->value[TG_WHEEL_SPEED + i];
        r[i] = row->held_wheels >> i & 1 ? row->wheel_variance[i] : e->constants.variance[TG_WHEEL_SPEED + i] + row->doubt[i];
    }
    y[n] = d * row->value[TG_GROUND_SPEED];
    r[n] = row->ground_variance;
    y[n + 1] = d * row->value[TG_ACCELERATION_X];
    r[n + 1] = e->constants.least_jolt + e->settings.tuned.swing * (e->jolt - e->constants.least_jolt);
}

/* What the accelerometer reads beyond the model, its mean square over about jolt_memory: on rough ground the body's jolts are
 * larger than the sensor's noise. */
static void watch_jolts(tg_estimator *e, const tg_step *step, tg_real r, tg_real dt)
{
    const int32_t c = e->settings.machine.wheels + 1;
    if (isnan(step->innovation[c])) return;
    tg_real square = tgi_square(step->innovation[c]), bound = 16 * step->innovation_variance[c];
    if (square > bound) square = bound;
    e->jolt += dt / (e->settings.tuned.jolt_memory + dt) * (square - (step->innovation_variance[c] - r) - e->jolt);
    if (e->jolt < e->constants.least_jolt) e->jolt = e->constants.least_jolt;
}

static tg_real supervisor_of(const tg_estimator *e, const tg_step *step)
{
    tg_real mean = 0;
    if (e->settings.tuning.policy != TG_BANK) return step->gamma;
    for (int32_t b = 0; b < TG_MODES; b++) mean += step->mode[b] * e->constants.scale_score[b];
    return mean;
}

/* A channel that the filter trusts much less than usual. A reckoned ground speed or a held wheel speed is no measurement. */
static int32_t is_outlier(const tg_estimator *e, const tg_row *row, const tg_step *step)
{
    const int32_t n = e->settings.machine.wheels, made_up = row->held_wheels | (row->reckoned ? 1 << n : 0);
    int32_t found = 0;
    for (int32_t c = 0; c < n + 2; c++) found |= step->weight[c] < e->settings.outlier_weight && !(made_up >> c & 1);
    return found;
}

/* NIS of the channels that were measured, each by itself where others were not. */
static void watch_consistency(tg_estimator *e, const tg_row *row, const tg_step *step, const tg_real *r)
{
    tg_belief *const b = &e->belief;
    b->nis = step->nis;
    b->channels = step->channels;
    if (!row->held_wheels) return;
    b->nis = 0;
    b->channels = 0;
    for (int32_t c = 0; c < e->settings.machine.wheels + 2; c++) {
        if (isnan(step->innovation[c]) || row->held_wheels >> c & 1) continue;
        b->nis += tgi_square(step->innovation[c]) / (step->innovation_variance[c] + r[c] * (1 / step->weight[c] - 1));
        b->channels++;
    }
}

/* The inputs as they were over the step that ends now: means of torque and drawbar force, of loads and slope between its ends. */
static void inputs_over(const tg_estimator *e, const tg_drive *drive, const tg_input *now, tg_input *over)
{
    const tg_real d = (tg_real)e->direction;
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) {
        over->torque[i] = d * drive->mean_torque[i];
        over->load[i] = (e->held.load[i] + now->load[i]) / 2;
    }
    over->drawbar = d * drive->mean_drawbar;
    over->slope = (e->held.slope + now->slope) / 2;
}

/* Predict over dt, in pieces where it is long, and update. Returns 0 where the filter had to start anew. */
static int32_t advance(tg_estimator *e, tg_row *row, const tg_drive *drive, tg_real dt, tg_real *q)
{
    const tg_settings *s = &e->settings;
    tg_real y[TG_MAX_CHANNELS], r[TG_MAX_CHANNELS];
    tg_input now, over;
    tg_step step;
    int32_t pieces = 1;
    if (dt > s->max_step) {
        pieces = dt / s->max_step < 300 ? (int32_t)(dt / s->max_step) + 1 : 300;
        dt /= (tg_real)pieces;
        for (int32_t j = 0; j < TG_MAX_STATES; j++) q[j] /= (tg_real)pieces;
    }
    tgi_along(e, drive, &now);
    inputs_over(e, drive, &now, &over);
    measured(e, row, y, r);
    tgi_deviations(e, &over, e->belief.x);
    tg_status status = TG_OK;
    for (int32_t k = 1; k < pieces && status == TG_OK; k++) {
        status = tg_filter_predict(&e->filter, dt, &over, q);
        if (status == TG_OK) follow(e, e->deviation);
    }
    if (status == TG_OK) status = tg_filter_step(&e->filter, dt, &over, &now, q, y, r, &step);
    if (status != TG_OK) {
        forget(e);
        restart_from(e, row, 0, 0);
        return 0;
    }
    follow(e, e->deviation);
    watch_jolts(e, &step, r[s->machine.wheels + 1], dt);
    watch_consistency(e, row, &step, r);
    e->belief.supervisor = supervisor_of(e, &step);
    row->outlier |= is_outlier(e, row, &step);
    return 1;
}

/* ---- a row ---- */

typedef enum { TG_WAIT, TG_ANEW, TG_DRIFT, TG_REST, TG_GO } tg_course;

static tg_course course_of(const tg_estimator *e, const tg_row *row, int32_t was_standing, int32_t turned, int32_t *gap)
{
    double silence = row->time - e->measured_time;
    *gap = e->seen_motion && silence > (double)e->settings.gap;
    if (!e->seen_motion) return row->measured ? (e->standing ? TG_REST : TG_ANEW) : TG_WAIT;
    if (*gap && !row->measured) return TG_DRIFT;
    if (e->standing) return TG_REST;
    return *gap || turned || was_standing ? TG_ANEW : TG_GO;
}

static void balance_forces(tg_estimator *e, const tg_drive *drive, double time)
{
    const tg_machine *m = &e->settings.machine;
    const int32_t n = m->wheels;
    const tg_real d = (tg_real)e->direction;
    tg_real force = -d * drive->calm_drawbar - e->belief.x[n] * m->mass * m->gravity * drive->cosine;
    for (int32_t i = 0; i < n; i++) force += e->belief.x[i] * drive->load[i];
    tgi_lowpass(&e->balance, e->standing ? 0 : d * force * e->constants.inverse_mass, time, e->settings.load_filter);
}

static int32_t go_on(tg_estimator *e, tg_row *row, const tg_drive *drive, tg_course course, int32_t start, tg_real dt, tg_real *q)
{
    int32_t sound = 1;
    tg_belief *b = &e->belief;
    b->nis = b->supervisor = 0;
    e->scene.anew = 0;
    b->channels = 0;
    if (e->settings.method == TG_ALGEBRAIC) {
        if (course == TG_ANEW || course == TG_GO) tgi_algebraic(e, row, drive, course == TG_ANEW);
        return 1;
    }
    if (course == TG_ANEW) restart_from(e, row, start, dt);
    if (course == TG_ANEW && start && e->started) unknown_adhesion(e);
    if (course == TG_DRIFT) drift(e, dt);
    else if (course == TG_REST) rest(e);
    else if (course == TG_GO) sound = advance(e, row, drive, dt, q);
    tgi_believe(e);
    return sound;
}

static void report(tg_estimator *e, const tg_drive *drive, tg_estimate *out)
{
    tg_real *o = out->value;
    memcpy(e->scene.load, drive->load, sizeof drive->load);
    for (int32_t i = 0; i < e->settings.machine.wheels; i++)
        e->scene.hub[i] = -(tg_real)e->direction * e->settings.wheel_side[i] * e->yaw_rate;
    e->scene.direction = (tg_real)e->direction;
    e->scene.standing = (tg_real)e->standing;
    e->scene.seen_motion = (tg_real)e->seen_motion;
    e->scene.roughness = e->roughness.wander;
    e->scene.unseen_load = tgi_unseen_load(e);
    tgi_traction(&e->settings, &e->belief, (const tg_real(*)[TG_ROWS])e->consider.s, &e->scene, o);
    o[TG_OUT_NIS] = e->belief.nis;
    o[TG_OUT_CHANNELS] = (tg_real)e->belief.channels;
    o[TG_OUT_SUPERVISOR] = e->belief.supervisor;
    o[TG_OUT_DISTANCE] = (tg_real)out->distance;
    for (int32_t k = 0; k < e->settings.axles; k++) o[TG_OUT_VERTICAL_LOAD + k] = drive->axle_load[k];
}

/* A_k before this row moves it: with gamma of the row it makes the row's Q (PHYSICS 6). */
static void tell_adaptation(const tg_estimator *e, tg_real *o)
{
    const int32_t policy = e->settings.tuning.policy;
    if (policy != TG_ADAPTIVE && policy != TG_SUPERVISED) return;
    for (int32_t j = 0; j < e->filter.states; j++)
        o[TG_OUT_ADAPTATION + j] = e->filter.policy.adaptation.scale[tgi_row(e->filter.wheels, j)];
}

/* What blinds comes first, then what stops the vehicle. */
static int32_t event_of(const tg_estimator *e, const tg_row *row, int32_t gap, int32_t lost)
{
    if (lost) return TG_EVENT_RESTART;
    if (gap) return TG_EVENT_GAP;
    if (e->standing) return TG_EVENT_STANDSTILL;
    const int32_t watched = tgi_watched(e);
    return watched != TG_EVENT_NONE ? watched : row->outlier ? TG_EVENT_OUTLIER : TG_EVENT_NONE;
}

tg_status tg_estimator_update(tg_estimator *e, const tg_sample *sample, tg_estimate *out)
{
    if (!e || !sample || !out) return TG_BAD_ARGUMENT;
    if (isnan(sample->time) || isinf(sample->time)) return TG_NOT_FINITE;
    if (e->started && !(sample->time > e->time)) return TG_TIME_REVERSED;
    tg_row row;
    tg_drive drive;
    tg_status status = tgi_clean(e, sample, &row);
    if (status != TG_OK) return status;
    if (e->settings.method == TG_SPEEDS) {
        tgi_speeds_update(e, &row, out);
        return TG_OK;
    }

    int32_t was_standing = e->standing, gap, n = e->settings.machine.wheels;
    tg_real dt = e->started ? (tg_real)(row.time - e->time) : 0, travelled = tgi_fabs(e->belief.x[n + 1]);
    tgi_doubt_speeds(e, &row);
    int32_t turned = tgi_track_motion(e, &row);
    tgi_track_turn(e, &row);
    tg_real q[TG_MAX_STATES];
    tgi_take_inputs(e, &row, dt, &drive);
    tgi_input_noise(e, row.time, dt, q);
    tgi_loads(e, &row, &drive);
    tg_course course = course_of(e, &row, was_standing, turned, &gap);
    if (!e->started) e->ground_time = row.time;
    tgi_reckon(e, &drive, course == TG_GO ? dt : 0, &row, q);
    if (e->settings.method == TG_FILTERED) tgi_hold_wheels(e, course == TG_GO ? dt : 0, &row);
    tell_adaptation(e, out->value);
    const int32_t lost = !go_on(e, &row, &drive, course, was_standing || turned, dt, q), breaks = gap || lost;
    balance_forces(e, &drive, row.time);
    tgi_watch_roughness(e, course == TG_GO && !breaks, e->standing ? 0 : travelled * dt);
    if (course == TG_GO && !row.reckoned && !isnan(row.value[TG_GROUND_SPEED])) tgi_remember_slip(e, &drive, dt);

    if (course == TG_GO && !breaks) e->distance += (double)((travelled + tgi_fabs(e->belief.x[n + 1])) / 2 * dt);
    if (row.measured) {
        e->seen_motion = 1;
        e->measured_time = row.time;
    }
    e->started = 1;
    e->time = row.time;
    tgi_along(e, &drive, &e->held);
    out->time = row.time;
    out->distance = e->distance;
    report(e, &drive, out);
    tgi_watch_over(e, &row, &drive, course == TG_GO || course == TG_ANEW, course == TG_ANEW || breaks, dt, out->value);
    out->event = event_of(e, &row, gap || course == TG_WAIT, lost);
    const int32_t learn = out->event == TG_EVENT_NONE || out->event == TG_EVENT_IMMOBILIZATION;
    tgi_curves(e, course == TG_GO && learn && !row.outlier, dt, e->standing ? 0 : travelled * dt, drive.load, out->value);
    return TG_OK;
}

static void fill(tg_sample *sample, const double *time, const double *const *in, const int32_t *given, int32_t count, size_t row)
{
    sample->time = time[row];
    for (int32_t k = 0; k < count; k++) sample->value[given[k]] = (tg_real)in[given[k]][row];
}

/* Rows are handed over in batches, column after column: one row at a time would touch a page of every column each time. */
typedef struct {
    tg_estimate row[TG_BATCH];
    int32_t wanted[TG_OUT_SLOTS], columns;
    size_t first, rows;
} batch;

static void hand_over(batch *b, double *const *out)
{
    for (int32_t k = 0; k < b->columns; k++) {
        const int32_t slot = b->wanted[k];
        double *const to = out[slot] + b->first;
        for (size_t j = 0; j < b->rows; j++) to[j] = (double)b->row[j].value[slot];
    }
    if (out[TG_OUT_DISTANCE]) /* unrounded on the float build */
        for (size_t j = 0; j < b->rows; j++) out[TG_OUT_DISTANCE][b->first + j] = b->row[j].distance;
    b->first += b->rows;
    b->rows = 0;
}

tg_status tg_estimator_block(tg_estimator *e, size_t rows, const double *time, const double *const *in, double *const *out,
                             uint8_t *event, size_t *done)
{
    if (!e || !time || !in || !out || !event || !done) return TG_BAD_ARGUMENT;
    tg_sample sample[2]; /* the next one is filled while this one is worked on: lanes cannot be read right after their parts are written */
    batch kept;
    int32_t given[TG_SLOTS], n_given = 0;
    tg_status status = TG_OK;
    for (int32_t k = 0; k < TG_SLOTS; k++) {
        sample[0].value[k] = sample[1].value[k] = (tg_real)NAN;
        if (in[k]) given[n_given++] = k;
    }
    kept.columns = 0;
    kept.first = kept.rows = 0;
    for (int32_t k = 0; k < TG_OUT_SLOTS; k++)
        if (out[k]) kept.wanted[kept.columns++] = k;
    *done = 0;
    if (rows > 0) fill(&sample[0], time, in, given, n_given, 0);
    for (; *done < rows; ++*done) {
        const size_t row = *done;
        if (row + 1 < rows) fill(&sample[(row + 1) % 2], time, in, given, n_given, row + 1);
        tg_estimate *const estimate = &kept.row[kept.rows];
        status = tg_estimator_update(e, &sample[row % 2], estimate);
        if (status != TG_OK) break;
        event[row] = (uint8_t)estimate->event;
        kept.rows++;
        if (kept.rows == TG_BATCH) hand_over(&kept, out);
    }
    hand_over(&kept, out);
    return status;
}
