/* One raw sample in, one row of estimates out. */
#include "estimator.h"

#define TG_BATCH 32

/* ---- the filter ---- */

/* The row's channels along the travel, and their variances. The accelerometer's shocks last several samples, so they are no white noise,
 * and count shock_samples times. */
static void measured(const tg_estimator *e, const tg_row *row, tg_real *y, tg_real *r)
{
    const int32_t n = e->settings.machine.wheels;
    const tg_real d = (tg_real)e->direction;
    for (int32_t i = 0; i < n; i++) {
        y[i] = d * row->value[TG_WHEEL_SPEED + i];
        r[i] = row->steady_wheels >> i & 1 ? row->wheel_variance[i] : e->constants.variance[TG_WHEEL_SPEED + i] + row->doubt[i];
    }
    y[n] = d * row->value[TG_GROUND_SPEED];
    r[n] = row->ground_variance;
    y[n + 1] = d * row->value[TG_ACCELERATION_X];
    r[n + 1] = e->constants.least_shock + e->settings.tuned.shock_samples * (e->shock - e->constants.least_shock);
}

/* What the accelerometer reads beyond the model, its mean square over about shock_memory: on rough ground the body's shocks are
 * larger than the sensor's noise. */
static void watch_shocks(tg_estimator *e, const tg_step *step, tg_real r, tg_real dt)
{
    const int32_t c = e->settings.machine.wheels + 1;
    if (isnan(step->innovation[c])) return;
    tg_real square = tgi_square(step->innovation[c]), bound = 16 * step->innovation_variance[c];
    if (square > bound) square = bound;
    e->shock += dt / (e->settings.tuned.shock_memory + dt) * (square - (step->innovation_variance[c] - r) - e->shock);
    if (e->shock < e->constants.least_shock) e->shock = e->constants.least_shock;
}

static tg_real supervisor_of(const tg_estimator *e, const tg_step *step)
{
    tg_real mean = 0;
    if (e->settings.tuning.policy != TG_BANK) return step->gamma;
    for (int32_t b = 0; b < TG_MODES; b++) mean += step->mode[b] * e->constants.scale_score[b];
    return mean;
}

/* NIS of the row and of each measured channel, and whether the filter trusts one of these much less than usual: the row is an outlier. With
 * a held wheel speed or a reckoned ground speed in it, which are no measurements, the row's NIS is the sum of the measured channels'. */
static void watch_consistency(tg_estimator *e, tg_row *row, const tg_step *step, const tg_real *r)
{
    int32_t count = 0, n = e->settings.machine.wheels, not_measured = row->steady_wheels | (row->reckoned ? 1 << n : 0);
    tg_real sum = 0;
    for (int32_t c = 0; c < n + 2; c++) {
        if (isnan(step->innovation[c]) || not_measured >> c & 1) continue;
        const tg_real w = step->weight[c];
        const tg_real variance = step->innovation_variance[c] + (w < 1 ? r[c] * (1 / w - 1) : 0);
        sum += row->channel_nis[c] = tgi_square(step->innovation[c]) / variance;
        row->outlier |= w < e->settings.outlier_weight;
        count++;
    }
    e->belief.nis = not_measured ? sum : step->nis;
    e->belief.channels = not_measured ? count : step->channels;
}

/* N, that the soil's resistance is a share of. */
static tg_real weight_on_ground(const tg_estimator *e, const tg_drive *drive)
{
    return drive->mass * e->settings.machine.gravity * drive->cosine + drive->hitch_load;
}

/* Predict over dt, in pieces of at most max_step, and update. Returns 0 where the filter had to restart. */
static int32_t advance(tg_estimator *e, tg_row *row, const tg_drive *drive, tg_input *now, tg_real dt, tg_real *q)
{
    const tg_settings *s = &e->settings;
    tg_real y[TG_MAX_CHANNELS], r[TG_MAX_CHANNELS];
    tg_step step;
    int32_t pieces = 1;
    /* In pieces, because the noise of a prediction enters at its end. A step that is a multiple but for its clock's rounding has as many. */
    const tg_real steps = (tg_real)0.999 * dt / s->max_step;
    if (steps >= 1) {
        pieces = steps < 300 ? (int32_t)steps + 1 : 300;
        dt /= (tg_real)pieces;
        for (int32_t j = 0; j < TG_MAX_STATES; j++) q[j] /= (tg_real)pieces;
    }
    measured(e, row, y, r);
    tgi_deviations(e, now, e->belief.x);
    if (tgi_on_the_spot(e)) now->hitch_load -= weight_on_ground(e, drive); /* the model holds the vehicle back by rho_s of its weight and this */
    tg_status status = TG_OK;
    for (int32_t k = 1; k < pieces && status == TG_OK; k++) {
        status = tg_filter_predict(&e->filter, dt, now, q);
        if (status == TG_OK) tgi_follow(e, &e->deviations);
    }
    if (status == TG_OK) status = tg_filter_step(&e->filter, dt, now, now, q, y, r, &step);
    if (status != TG_OK) {
        tgi_forget(e);
        tgi_restart_from(e, row, 0);
        return 0;
    }
    tgi_follow(e, &e->deviations);
    watch_shocks(e, &step, r[s->machine.wheels + 1], dt);
    watch_consistency(e, row, &step, r);
    const tg_real innovation = step.innovation[s->machine.wheels], variance = step.innovation_variance[s->machine.wheels];
    tgi_watch_innovation(e, row, innovation, variance);
    if (!isnan(innovation) && !row->reckoned && !e->slope.running) tgi_watch_draw(e, innovation, variance, 1 - row->ground_variance / variance);
    e->belief.supervisor = supervisor_of(e, &step);
    return 1;
}

/* ---- a row ---- */

typedef enum { TG_WAIT, TG_ANEW, TG_DRIFT, TG_REST, TG_START, TG_TURN, TG_GO } tg_course; /* TG_START: goes on from rest, TG_TURN: the other way */

static tg_course course_of(const tg_estimator *e, const tg_row *row, int32_t was_standing, int32_t turned, int32_t *gap)
{
    double silence = row->time - e->measured_time;
    *gap = e->seen_motion && silence > (double)e->settings.gap;
    if (!e->seen_motion) return row->measured ? (e->standing ? TG_REST : TG_ANEW) : TG_WAIT;
    if (*gap && !row->measured) return TG_DRIFT;
    if (e->standing) return TG_REST;
    return *gap ? TG_ANEW : turned ? (was_standing ? TG_START : TG_TURN) : was_standing ? TG_START : TG_GO;
}

static void balance_forces(tg_estimator *e, const tg_drive *drive, double time)
{
    const tg_machine *m = &e->settings.machine;
    const int32_t n = m->wheels;
    const tg_real d = (tg_real)e->direction;
    tg_real force = -d * drive->calm_drawbar - (tgi_on_the_spot(e) ? 0 : e->belief.x[n] * weight_on_ground(e, drive));
    for (int32_t i = 0; i < n; i++) force += e->belief.x[i] * drive->load[i];
    tgi_lowpass(&e->balance, e->standing ? 0 : d * force * drive->inverse_mass, time, e->settings.load_filter);
}

static int32_t go_on(tg_estimator *e, tg_row *row, const tg_drive *drive, tg_input *now, tg_course course, tg_real dt, tg_real *q)
{
    int32_t sound = 1;
    tg_belief *b = &e->belief;
    b->nis = b->supervisor = 0;
    e->scene.anew = course == TG_TURN; /* to a smoother: values along the travel change their signs */
    b->channels = 0;
    if (e->settings.method == TG_ALGEBRAIC) {
        if (course != TG_WAIT && course != TG_DRIFT && course != TG_REST) tgi_algebraic(e, row, drive, now, course != TG_GO);
        return 1;
    }
    if (course == TG_REST) tgi_rest_reading(e, row);
    else {
        tgi_rest_over(e);
        e->by_torque = 0;
    }
    if (course == TG_ANEW) tgi_restart_from(e, row, dt);
    if (course == TG_TURN) tgi_turn(e);
    if (course == TG_TURN || (course == TG_START && e->started)) tgi_unknown_adhesion(e);
    if (course == TG_DRIFT) tgi_drift(e, dt);
    else if (course == TG_REST) tgi_rest(e, drive, row->time);
    else if (course >= TG_START) sound = advance(e, row, drive, now, dt, q);
    tgi_believe(e);
    return sound;
}

/* No wheel speed was measured for longer than a gap: what the model makes of the wheels since then is no slip. */
static int32_t wheels_are_silent(const tg_estimator *e, double time)
{
    for (int32_t i = 0; i < e->settings.machine.wheels; i++)
        if (e->wheel[i].count > 0 && time - e->wheel[i].time <= (double)e->settings.gap && !tgi_rolls(e, i)) return 0;
    return 1;
}

static void report(tg_estimator *e, const tg_row *row, const tg_drive *drive, tg_estimate *out)
{
    const int32_t n = e->settings.machine.wheels;
    tg_real *o = out->value;
    memcpy(e->scene.load, drive->load, sizeof drive->load);
    for (int32_t i = 0; i < n; i++) {
        e->scene.hub[i] = -(tg_real)e->direction * e->settings.wheel_side[i] * e->yaw_rate;
        e->scene.across[i] = e->settings.wheel_ahead[i] * e->yaw_rate;
    }
    for (int32_t i = 0; i < n; i += TG_LANES)
        lanes_store(e->scene.turn + i, tgi_turn_variance(&e->settings, i, lanes_load(e->belief.x + n + 2 + i), e->belief.x[n + 1], (tg_real)e->direction * e->unseen_turn));
    e->scene.direction = (tg_real)e->direction;
    e->scene.standing = (tg_real)(e->standing || wheels_are_silent(e, out->time));
    e->scene.seen_motion = (tg_real)e->seen_motion;
    tgi_find_silent(e, out->time);
    e->scene.bumps = tgi_unseen_bumps(e);
    e->scene.weight = drive->mass * e->settings.machine.gravity + drive->hitch_load;
    e->scene.unseen_load = tgi_unseen_load(e);
    if (e->constants.warps) e->scene.unseen_load += tgi_lasting_warp(e, e->scene.warp);
    e->scene.unseen_grade = tgi_unseen_grade(e);
    tgi_doubt_adhesions(e, row, drive);
    e->scene.slow_speed = tgi_slow_variance(e);
    e->scene.disputed = tgi_disputed_variance(e, drive);
    e->scene.late = tgi_late_variance(e, drive);
    tgi_traction(&e->settings, e->warped.now, &e->belief, (const tg_real(*)[TG_MAX_CONSIDERED])e->consider.s, &e->scene, o);
    tgi_watch_signs(e, o);
    o[TG_OUT_SUPERVISOR] = e->belief.supervisor;
    for (int32_t k = 0; k < e->settings.axles; k++) o[TG_OUT_VERTICAL_LOAD + k] = drive->axle_load[k];
}

/* A_k before this row moves it: with gamma of the row it makes the row's Q (physics.md 6). */
static void report_adaptation(const tg_estimator *e, tg_real *o)
{
    const int32_t policy = e->settings.tuning.policy;
    if (policy != TG_ADAPTIVE && policy != TG_SUPERVISED) return;
    for (int32_t j = 0; j < e->filter.states; j++)
        o[TG_OUT_ADAPTATION + j] = e->filter.policy.adaptive.adaptation.scale[tgi_row(e->filter.wheels, j)];
}

/* Whether nothing determines slip: after a gap, before both a wheel speed and the ground speed are back, and while wheels are silent. */
static int32_t is_blind(tg_estimator *e, const tg_row *row, int32_t gap)
{
    if (gap) e->unseen = 3;
    for (int32_t i = 0; i < e->settings.machine.wheels; i++)
        if (e->wheel[i].count > 0 && e->wheel[i].time == row->time && !tgi_rolls(e, i)) e->unseen &= ~1;
    if (e->ground.count > 0 && e->ground.time == row->time) e->unseen &= ~2;
    return e->unseen != 0 || e->scene.any_silent > 0 || wheels_are_silent(e, row->time);
}

/* What blinds comes first, then what stops the vehicle. */
int32_t tgi_event_of(const tg_estimator *e, const tg_row *row, int32_t gap, int32_t lost)
{
    if (lost) return TG_EVENT_RESTART;
    if (gap || tgi_ground_is_silent(e, row->time)) return TG_EVENT_GAP;
    if (e->standing) return TG_EVENT_STANDSTILL;
    const int32_t watched = tgi_watched(e);
    return watched != TG_EVENT_NONE ? watched : row->outlier ? TG_EVENT_OUTLIER : TG_EVENT_NONE;
}

/* The row was estimated; its time, way and consistency as outputs have them. */
void tgi_end_row(tg_estimator *e, const tg_row *row, tg_estimate *out)
{
    if (row->measured) {
        e->seen_motion = 1;
        e->measured_time = row->time;
    }
    e->started = 1;
    e->time = out->time = row->time;
    out->distance = e->distance;
    out->value[TG_OUT_DISTANCE] = (tg_real)e->distance;
    out->value[TG_OUT_NIS] = e->belief.nis;
    out->value[TG_OUT_CHANNELS] = (tg_real)e->belief.channels;
    memcpy(out->value + TG_OUT_CHANNEL_NIS, row->channel_nis, sizeof row->channel_nis);
}

/* Inputs along the travel, in the other direction. */
static void mirror(tg_input *u, int32_t wheels)
{
    for (int32_t i = 0; i < wheels; i++) u->torque[i] = -u->torque[i];
    u->drawbar = -u->drawbar;
    u->slope = -u->slope;
}

/* How fast the wheels' hubs go in the mean, in a turn on the spot too. */
static tg_real speed_of_hubs(const tg_estimator *e)
{
    const int32_t n = e->settings.machine.wheels;
    const tg_real v = e->belief.x[n + 1], yaw = (tg_real)e->direction * e->yaw_rate;
    tg_real speed = 0;
    for (int32_t i = 0; i < n; i++) speed += tgi_fabs(v - e->settings.wheel_side[i] * yaw);
    return speed / (tg_real)n;
}

static tg_status accept(tg_estimator *e, const tg_sample *sample, tg_row *row)
{
    if (isnan(sample->time) || isinf(sample->time)) return TG_NOT_FINITE;
    if (e->started && !(sample->time > e->time)) return TG_TIME_REVERSED;
    return tgi_clean(e, sample, row);
}

/* Which outputs a row writes depends on the settings alone: NaN stays in those that this vehicle or method does not have. */
static void blank(tg_estimate *out)
{
    for (int32_t k = 0; k < TG_OUT_SLOTS; k++) out->value[k] = (tg_real)NAN;
}

static void estimate_row(tg_estimator *e, const tg_sample *sample, tg_row *row, tg_estimate *out)
{
    if (e->settings.method == TG_SPEEDS) {
        tgi_speeds_update(e, row, out);
        return;
    }

    tg_drive drive;
    tg_input now;
    int32_t was_standing = e->standing, gap, n = e->settings.machine.wheels;
    tg_real dt = e->started ? (tg_real)(row->time - e->time) : 0, travelled = tgi_fabs(e->belief.x[n + 1]);
    tgi_doubt_speeds(e, row);
    tgi_watch_shares(e, sample);
    int32_t turned = tgi_track_motion(e, row);
    if (turned) mirror(&e->held, n);
    tgi_track_turn(e, row);
    tg_real q[TG_MAX_STATES];
    tgi_update_inputs(e, row, dt, &drive);
    const tg_course course = course_of(e, row, was_standing, turned, &gap);
    tgi_time_wheels(e, dt, course >= TG_START, row);
    tgi_input_noise(e, &drive, dt, row, q);
    tgi_loads(e, row, &drive);
    tgi_along(e, &drive, &now);
    if (!e->started) e->ground_time = row->time;
    tgi_reckon(e, &drive, dt, course == TG_GO, row, q);
    report_adaptation(e, out->value);
    const int32_t lost = !go_on(e, row, &drive, &now, course, dt, q), breaks = gap || lost, flows = course == TG_GO && !breaks && !e->braked;
    balance_forces(e, &drive, row->time);
    tgi_watch_roughness(e, flows, e->standing || breaks || e->braked ? 0 : speed_of_hubs(e) * dt); /* nothing shows how far it went in a gap */
    if (course == TG_GO && !e->braked && !row->reckoned && !isnan(row->value[TG_GROUND_SPEED])) tgi_remember_slip(e, &drive, dt);

    if (course == TG_GO && !breaks) e->distance += (double)((travelled + tgi_fabs(e->belief.x[n + 1])) / 2 * dt);
    tgi_end_row(e, row, out);
    e->held = now;
    report(e, row, &drive, out);
    const int32_t blind = is_blind(e, row, breaks) && course != TG_WAIT, moves = course >= TG_START || course == TG_ANEW;
    tgi_watch_over(e, row, &drive, !blind && moves, blind || (moves && course != TG_GO) || breaks, dt, out->value);
    out->event = tgi_event_of(e, row, gap || blind || course == TG_WAIT, lost);
    const int32_t learn = out->event == TG_EVENT_NONE || out->event == TG_EVENT_IMMOBILIZATION;
    tgi_curves(e, flows && learn && !row->outlier && !(e->slip_memory.astray > 0), dt, e->standing ? 0 : travelled * dt, drive.load, out->value);
}

tg_status tg_estimator_update(tg_estimator *e, const tg_sample *sample, tg_estimate *out)
{
    if (!e || !sample || !out) return TG_BAD_ARGUMENT;
    tg_row row;
    const tg_status status = accept(e, sample, &row);
    if (status != TG_OK) return status;
    blank(out);
    estimate_row(e, sample, &row, out);
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
    for (size_t j = 0; j < rows && j < TG_BATCH; j++) blank(&kept.row[j]);
    *done = 0;
    if (rows > 0) fill(&sample[0], time, in, given, n_given, 0);
    for (; *done < rows; ++*done) {
        const size_t row = *done;
        if (row + 1 < rows) fill(&sample[(row + 1) % 2], time, in, given, n_given, row + 1);
        tg_estimate *const estimate = &kept.row[kept.rows];
        tg_row cleaned;
        status = accept(e, &sample[row % 2], &cleaned);
        if (status != TG_OK) break;
        estimate_row(e, &sample[row % 2], &cleaned, estimate);
        event[row] = (uint8_t)estimate->event;
        kept.rows++;
        if (kept.rows == TG_BATCH) hand_over(&kept, out);
    }
    hand_over(&kept, out);
    return status;
}
